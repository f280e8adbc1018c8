// Tests the verticals. The rotation vector e from one direction to another is at right angles to both. A small error dx
// of a direction d turns it by d x dx, so that the covariance of e is [d]x C [d]x'. That matrix is singular along d;
// adding d d' makes it regular and changes nothing, because e has no part along d. e' (..)^-1 e is then chi-square with
// two degrees of freedom.
//
// The comparison. All pairs of n verticals would be too many, and rotations far apart in the graph are hardly known.
// Vicinity gives each node the 1st, 2nd, 3rd, 5th, 7th, 10th ... nearest node with a vertical, by the variance of the
// path between them (Dijkstra). Two disjoint-set forests then hold the verticals that were compared (regions) and those
// that agree (groups).
#include "adjust/orientation/vertical_check.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <queue>
#include <utility>

#include "adjust/orientation/steps/orientation_graph.h"
#include "adjust/terms/vertical_terms.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/transform/rotation.h"
#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

constexpr double kLevel = 1e-3;                 // share of correct pairs that the test rejects
constexpr double kLeaning = 1 * kDegree;        // allowance for walls that lean, and for a common drift of rotations
constexpr double kWorstRotation = 3 * kDegree;  // largest sigma of a relative rotation for a comparison
constexpr double kShareOfAll = 1. / 3, kShareOfAgreeing = 0.8;  // of an accepted group
constexpr std::size_t kFewest = 2;                              // verticals of a group

Eigen::Vector3d rotation_vector(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d cross = from.cross(to);
  const double sine = cross.norm();
  if (sine > 0) return std::atan2(sine, from.dot(to)) / sine * cross;
  return from.dot(to) > 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(std::numbers::pi * from.unitOrthogonal());
}

// Whether two directions are equal within the covariance of their difference.
bool same_direction(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Eigen::Matrix3d& covariance) {
  static const double limit = chi_square_quantile(kLevel, 2);
  const Eigen::Vector3d e = rotation_vector(from, to);
  const Eigen::Matrix3d across = skew(from);
  const Eigen::Matrix3d of_vector = across * covariance * across.transpose() + from * from.transpose();
  return e.dot(of_vector.inverse() * e) < limit;
}

// A vertical in the common axes.
struct Shown {
  std::size_t index = 0;  // in `seen`
  std::int32_t node = -1, camera = -1;
  Eigen::Vector3d direction;
  Eigen::Matrix3d covariance;
  Eigen::Matrix3Xd by_camera;
};

// Effect of the errors of the cameras on the difference of two directions.
Eigen::Matrix3d of_cameras(const Shown& a, const Shown& b) {
  if (a.camera == b.camera && a.by_camera.cols() == b.by_camera.cols()) {
    const Eigen::Matrix3Xd difference = a.by_camera - b.by_camera;
    return difference * difference.transpose();
  }
  return a.by_camera * a.by_camera.transpose() + b.by_camera * b.by_camera.transpose();
}

bool agree(const Shown& a, const Shown& b, double variance) {
  return same_direction(
      a.direction, b.direction,
      a.covariance + b.covariance + of_cameras(a, b) + (variance + kLeaning * kLeaning) * Eigen::Matrix3d::Identity());
}

// Chooses the nodes with verticals that are compared with a node: the nearest ones, and fewer and fewer of those
// farther away. The far ones make sure that a closely connected piece of the graph is compared with the rest too.
class Vicinity {
 public:
  Vicinity(std::size_t nodes, const std::vector<RelativeRotation>& edges, const std::vector<std::uint8_t>& kept,
           const std::vector<std::vector<std::size_t>>& shown_of)
      : shown_of_(shown_of), links_(nodes), best_(nodes), round_(nodes, -1) {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      if (!kept[e]) continue;
      const double variance = variance_of(edges[e]);
      links_[row(edges[e].a)].push_back({edges[e].b, variance});
      links_[row(edges[e].b)].push_back({edges[e].a, variance});
    }
  }

  struct Near {
    std::int32_t node = -1;
    double variance = 0;  // of the rotation to it, along the best path
  };
  std::vector<Near> of(std::int32_t start) {
    // The search ends after 256 nodes with verticals, of which sixteen are compared at most, or after 2 000 nodes of
    // any kind. Its cost does not grow with the block.
    constexpr std::size_t kReached = 256, kVisited = 2000;
    std::vector<Near> near{{start, 0}};
    std::size_t reached = 0, wanted = 1, visited = 0;
    using Open = std::pair<double, std::int32_t>;
    std::priority_queue<Open, std::vector<Open>, std::greater<>> open;
    const auto reach = [&](std::int32_t node, double variance) {
      // `round_` says for which start `best_` holds, so that the array need not be cleared for every node.
      if (variance > kWorstRotation * kWorstRotation || (round_[row(node)] == start && best_[row(node)] <= variance))
        return;
      round_[row(node)] = start;
      best_[row(node)] = variance;
      open.push({variance, node});
    };
    reach(start, 0);
    while (!open.empty() && reached < kReached && visited < kVisited) {
      const auto [variance, node] = open.top();
      open.pop();
      if (variance > best_[row(node)]) continue;
      ++visited;
      if (node != start && !shown_of_[row(node)].empty() && ++reached == wanted) {
        near.push_back({node, variance});
        wanted += 1 + wanted / 3;  // 1, 2, 3, 5, 7, 10, 14 ... 205
      }
      for (const auto& [other, step] : links_[row(node)]) reach(other, variance + step);
    }
    return near;
  }

 private:
  const std::vector<std::vector<std::size_t>>& shown_of_;            // [nodes]
  std::vector<std::vector<std::pair<std::int32_t, double>>> links_;  // [nodes] other node, variance
  std::vector<double> best_;
  std::vector<std::int32_t> round_;  // [nodes] the start that `best_` belongs to
};

class VerticalJudge {
 public:
  explicit VerticalJudge(std::vector<Shown> shown)
      : shown_(std::move(shown)), regions_(std::ssize(shown_)), groups_(std::ssize(shown_)), partners_(shown_.size()) {}

  void compare(std::size_t nodes, const std::vector<RelativeRotation>& edges, const std::vector<std::uint8_t>& kept) {
    std::vector<std::vector<std::size_t>> shown_of(nodes);
    for (std::size_t i = 0; i < shown_.size(); ++i) shown_of[row(shown_[i].node)].push_back(i);
    Vicinity vicinity(nodes, edges, kept, shown_of);
    for (std::size_t node = 0; node < nodes; ++node) {
      if (shown_of[node].empty()) continue;
      for (const auto& [other, variance] : vicinity.of(static_cast<std::int32_t>(node)))
        for (const std::size_t i : shown_of[node])
          for (const std::size_t j : shown_of[row(other)])
            if (row(other) != node || i < j) compare(i, j, variance);
    }
  }

  std::vector<VerticalVerdict> verdicts(const std::optional<AxisDirection>& down) {
    std::vector<VerticalVerdict> verdicts(shown_.size(), VerticalVerdict::kBelieved);
    std::map<std::int64_t, std::vector<std::size_t>> regions;
    for (std::size_t i = 0; i < shown_.size(); ++i) regions[regions_.find(static_cast<std::int64_t>(i))].push_back(i);
    for (const auto& [first, members] : regions) judge(members, down, verdicts);
    return verdicts;
  }

 private:
  // Verticals that are compared are of one region, whether they agree or not: a group is measured against its region.
  void compare(std::size_t i, std::size_t j, double variance) {
    const bool one = agree(shown_[i], shown_[j], variance);
    const auto a = static_cast<std::int64_t>(i), b = static_cast<std::int64_t>(j);
    regions_.unite(a, b);
    if (one) groups_.unite(a, b);
    partners_[i].emplace_back(j, one);
    partners_[j].emplace_back(i, one);
  }

  // A set of verticals that were compared with one another, directly or through others.
  void judge(const std::vector<std::size_t>& members, const std::optional<AxisDirection>& down,
             std::vector<VerticalVerdict>& verdicts) {
    std::map<std::int64_t, std::vector<std::size_t>> groups;
    for (const std::size_t i : members) groups[groups_.find(static_cast<std::int64_t>(i))].push_back(i);
    std::size_t all = members.size(), agreeing = 0;
    const std::vector<std::size_t>* largest = nullptr;
    for (const auto& [first, group] : groups) {
      // Where positions or attitudes tell what is down, a group is judged by them alone. The size of a wrong group
      // counts for nothing then.
      if (down && !is_down(group, *down)) {
        for (const std::size_t i : group) verdicts[i] = VerticalVerdict::kAgainstGround;
        all -= group.size();
        continue;
      }
      // `agreeing` counts the verticals that agree with any other, in this or another group.
      if (group.size() >= kFewest) agreeing += group.size();
      if (!largest || group.size() > largest->size()) largest = &group;
    }
    if (members.size() < kFewest || !largest) return;
    const auto size = static_cast<double>(largest->size());
    const bool believed = largest->size() >= kFewest && size >= kShareOfAll * static_cast<double>(all) &&
                          size >= kShareOfAgreeing * static_cast<double>(agreeing);
    const std::int64_t name = groups_.find(static_cast<std::int64_t>(largest->front()));
    for (const std::size_t i : members) {
      if (verdicts[i] != VerticalVerdict::kBelieved) continue;
      if (!believed)
        verdicts[i] = VerticalVerdict::kNoConsensus;
      else if (!belongs(i, name))
        verdicts[i] = VerticalVerdict::kContradicted;
    }
  }

  // Whether at least half of its partners in the group agree with it. A single partner may agree by accident.
  bool belongs(std::size_t i, std::int64_t group) {
    if (groups_.find(static_cast<std::int64_t>(i)) != group) return false;
    std::size_t partners = 0, agreeing = 0;
    for (const auto& [j, one] : partners_[i]) {
      if (groups_.find(static_cast<std::int64_t>(j)) != group) continue;
      ++partners;
      agreeing += one;
    }
    return 2 * agreeing >= partners;
  }

  bool is_down(const std::vector<std::size_t>& group, const AxisDirection& down) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance =
        Eigen::Matrix3d::Zero();  // the mean, because the images of one camera share its errors
    for (const std::size_t i : group) {
      sum += shown_[i].direction;
      covariance += (shown_[i].covariance + shown_[i].by_camera * shown_[i].by_camera.transpose()) /
                    static_cast<double>(group.size());
    }
    return sum.norm() > 0 &&
           same_direction(down.direction, sum.normalized(),
                          down.covariance + covariance + kLeaning * kLeaning * Eigen::Matrix3d::Identity());
  }

  std::vector<Shown> shown_;
  DisjointSets regions_, groups_;  // of `shown_`: those compared with one another; those that agree
  std::vector<std::vector<std::pair<std::size_t, bool>>> partners_;  // [shown] row, whether they agree
};

}  // namespace

std::vector<VerticalVerdict> judge_verticals(const std::vector<std::optional<Eigen::Quaterniond>>& rotation,
                                             const std::vector<RelativeRotation>& edges,
                                             const std::vector<std::uint8_t>& kept, const std::vector<SeenDown>& seen,
                                             const std::optional<AxisDirection>& down) {
  std::vector<Shown> shown;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!rotation[row(seen[i].node)]) continue;
    const Eigen::Matrix3d to_world = rotation[row(seen[i].node)]->conjugate().toRotationMatrix();
    // Directions in the common axes of the averaged rotations: R'd, covariances R'S R.
    shown.push_back({i, seen[i].node, seen[i].camera, to_world * seen[i].direction,
                     to_world * seen[i].covariance * to_world.transpose(), to_world * seen[i].by_camera});
  }
  std::vector<std::size_t> index;
  for (const Shown& s : shown) index.push_back(s.index);
  VerticalJudge judge(std::move(shown));
  judge.compare(rotation.size(), edges, kept);
  const std::vector<VerticalVerdict> found = judge.verdicts(down);
  // Where every vertical that could be compared is wrong, those that could not be compared are probably wrong too.
  const bool none = !found.empty() && std::count(found.begin(), found.end(), VerticalVerdict::kBelieved) == 0;
  std::vector<VerticalVerdict> verdicts(seen.size(), none ? VerticalVerdict::kNoConsensus : VerticalVerdict::kBelieved);
  for (std::size_t i = 0; i < found.size(); ++i) verdicts[index[i]] = found[i];
  return verdicts;
}

namespace {

constexpr double kApproximate = 5 * kDegree;  // sigma of given poses

// World -> camera by the frame's given pose.
std::optional<Eigen::Quaterniond> given_rotation(const Block& block, ImageIndex image) {
  const std::optional<Pose>& given = block.frames[block.images[image].frame].given_pose;
  if (!given) return std::nullopt;
  return block.mount_of(image).pose.rotation * given->rotation;
}

struct JudgedByPose {
  ImageIndex image;
  bool down = false;
  Eigen::Vector3d direction;   // of the world
  Eigen::Matrix3d covariance;  // of both
};

// The largest number of verticals that show one direction other than down. At most fifty directions are tried.
std::size_t most_alike(const std::vector<JudgedByPose>& judged) {
  constexpr std::size_t kTried = 50;
  std::size_t most = 0;
  for (std::size_t i = 0; i < judged.size(); i += 1 + judged.size() / kTried) {
    const JudgedByPose& one = judged[i];
    if (one.down) continue;
    most = std::max(most, static_cast<std::size_t>(std::ranges::count_if(judged, [&](const JudgedByPose& other) {
                      return same_direction(one.direction, other.direction, one.covariance + other.covariance);
                    })));
  }
  return most;
}

}  // namespace

std::vector<SetAsideVertical> against_given_poses(const Block& block) {
  const GroundVertical ground(block.ground);
  std::vector<JudgedByPose> judged;
  for (const SeenVertical& vertical : block.verticals) {
    const auto rotation = given_rotation(block, vertical.image);
    if (!rotation) continue;
    const Camera& camera = block.cameras[block.camera_of(vertical.image)];
    const AxisDirection seen = whole_error(vertical, camera, camera.intrinsics);
    const Eigen::Matrix3d to_world = rotation->conjugate().toRotationMatrix();
    JudgedByPose by_pose{vertical.image, false, to_world * seen.direction,
                         to_world * seen.covariance * to_world.transpose() +
                             (kApproximate * kApproximate + kLeaning * kLeaning) * Eigen::Matrix3d::Identity()};
    const Eigen::Vector3d down = ground.down(block.frames[block.images[vertical.image].frame].given_pose->centre);
    by_pose.down = same_direction(by_pose.direction, down, by_pose.covariance);
    judged.push_back(by_pose);
  }
  // A single direction that is shared by four fifths and is not down says that the world of the poses is tilted.
  const bool level = judged.size() < 2 || 5 * most_alike(judged) < 4 * judged.size();
  std::vector<SetAsideVertical> aside;
  for (const JudgedByPose& one : judged)
    if (!level || !one.down)
      aside.push_back({one.image, level ? VerticalVerdict::kAgainstGround : VerticalVerdict::kAgainstPoses});
  std::sort(aside.begin(), aside.end(),
            [](const SetAsideVertical& a, const SetAsideVertical& b) { return a.image < b.image; });
  return aside;
}

bool given_poses_join(const Block& block, ImageIndex a, const AxisDirection& seen_a, ImageIndex b,
                      const AxisDirection& seen_b) {
  const auto rotation_a = given_rotation(block, a), rotation_b = given_rotation(block, b);
  if (!rotation_a || !rotation_b) return true;
  const Eigen::Matrix3d relative = (*rotation_b * rotation_a->conjugate()).toRotationMatrix();
  // The errors of both given poses, and of both walls.
  const double variance = 2 * (kApproximate * kApproximate + kLeaning * kLeaning);
  return same_direction(
      relative * seen_a.direction, seen_b.direction,
      relative * seen_a.covariance * relative.transpose() + seen_b.covariance + variance * Eigen::Matrix3d::Identity());
}

}  // namespace megablock
