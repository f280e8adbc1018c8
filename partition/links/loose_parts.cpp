#include "partition/links/loose_parts.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <utility>

#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

using Frames = std::vector<FrameIndex>;

bool has_arms(const Rig& rig) {
  return std::ranges::any_of(rig.cameras(),
                             [&](const Mount& m) { return m.pose.centre != rig.mounts.front().pose.centre; });
}

// Frames whose distances from each other are known without tie points, ascending.
Frames frames_of_known_length(const Block& block, const BlockState& state) {
  IndexedVector<FrameIndex, std::uint8_t> control(block.frames.size(), 0), known(block.frames.size(), 0);
  for (const ControlPoint& point : block.control_points) {
    if (point.role != PointRole::kControl) continue;
    Frames seen_by;
    for (const ImageMeasurement& m : point.measurements) seen_by.push_back(block.images[m.image].frame);
    std::ranges::sort(seen_by);
    seen_by.erase(std::unique(seen_by.begin(), seen_by.end()), seen_by.end());
    for (const FrameIndex f : seen_by) control[f] = static_cast<std::uint8_t>(std::min(control[f] + 1, 2));
  }
  for (const RelativePose& pose : block.relative_poses) known[pose.from] = known[pose.to] = 1;
  Frames result;
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    const Frame& frame = block.frames[f];
    if (state.oriented[f] &&
        (known[f] || control[f] > 1 || frame.given_pose || frame.position_prior || has_arms(block.rigs[frame.rig])))
      result.push_back(f);
  }
  return result;
}

// The good links of each frame, in compressed rows.
class GoodLinks {
 public:
  GoodLinks(const BlockState& state, const LinkWeights& links, std::int64_t enough) {
    const auto visit_good = [&](auto&& visit) {
      links.visit([&](const FrameEdge& edge) {
        if (edge.weight >= enough && state.oriented[edge.a] && state.oriented[edge.b]) visit(edge.a, edge.b);
      });
    };
    begin_.assign(state.oriented.size() + 1, 0);
    visit_good([&](FrameIndex a, FrameIndex b) {
      ++begin_[static_cast<std::size_t>(a.value) + 1];
      ++begin_[static_cast<std::size_t>(b.value) + 1];
    });
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    ends_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    visit_good([&](FrameIndex a, FrameIndex b) {
      ends_[next[static_cast<std::size_t>(a.value)]++] = static_cast<std::uint32_t>(b.value);
      ends_[next[static_cast<std::size_t>(b.value)]++] = static_cast<std::uint32_t>(a.value);
    });
  }
  template <typename Visit>
  void of(FrameIndex frame, Visit&& visit) const {
    const auto f = static_cast<std::size_t>(frame.value);
    for (std::size_t l = begin_[f]; l < begin_[f + 1]; ++l) visit(FrameIndex(ends_[l]));
  }
  std::size_t frames() const { return begin_.size() - 1; }

 private:
  std::vector<std::size_t> begin_;
  std::vector<std::uint32_t> ends_;
};

// Bodies, and the bodies of each frame. A frame of several bodies is a joint.
class Bodies {
 public:
  explicit Bodies(std::size_t frames) : of_(frames) {}

  void add(Frames frames) {
    std::ranges::sort(frames);
    for (const FrameIndex f : frames) of_[f].push_back(bodies_.size());
    bodies_.push_back(std::move(frames));
  }
  std::size_t size() const { return bodies_.size(); }
  const Frames& frames(std::size_t body) const { return bodies_[body]; }
  const std::vector<std::size_t>& of(FrameIndex frame) const { return of_[frame]; }
  bool share_one(FrameIndex a, FrameIndex b) const {
    return std::ranges::any_of(of_[a], [&](std::size_t body) { return std::ranges::count(of_[b], body) > 0; });
  }
  Frames joints(std::size_t body) const {
    Frames joints;
    std::ranges::copy_if(bodies_[body], std::back_inserter(joints), [&](FrameIndex f) { return of_[f].size() > 1; });
    return joints;
  }

 private:
  std::vector<Frames> bodies_;
  IndexedVector<FrameIndex, std::vector<std::size_t>> of_;
};

// The bodies that the links make. The first one begins with the frames of known length, if there are two.
Bodies bodies_of_links(const GoodLinks& links, const Frames& known) {
  Bodies bodies(links.frames());
  IndexedVector<FrameIndex, std::size_t> linked_with(links.frames(), links.frames());  // the latest body
  IndexedVector<FrameIndex, std::uint8_t> count(links.frames(), 0);                    // of these links, at most 2
  const auto grow = [&](Frames body) {
    const std::size_t number = bodies.size();
    for (const FrameIndex f : body) {
      linked_with[f] = number;
      count[f] = 2;
    }
    for (std::size_t i = 0; i < body.size(); ++i)
      links.of(body[i], [&](FrameIndex f) {
        if (linked_with[f] != number) count[f] = 0;
        linked_with[f] = number;
        if (count[f] < 2 && ++count[f] == 2) body.push_back(f);
      });
    bodies.add(std::move(body));
  };
  if (known.size() > 1) grow(known);
  for (FrameIndex a(0); static_cast<std::size_t>(a.value) < links.frames(); ++a.value)
    links.of(a, [&](FrameIndex b) {
      if (a < b && !bodies.share_one(a, b)) grow({a, b});
    });
  return bodies;
}

// Samples of the relative changes of scale u that the joints allow [bodies]. See the head of the header.
class ScaleChanges {
 public:
  ScaleChanges(const Bodies& bodies, const BlockState& state, std::size_t fixed)
      : bodies_(bodies), state_(state), fixed_(fixed) {
    for (std::size_t b = 0; b < bodies.size(); ++b) describe(bodies.frames(b));
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (b != fixed_) add_priors(b);
      for (const FrameIndex f : bodies.joints(b))
        if (bodies.of(f).front() != b) add_joint(f, bodies.of(f).front(), b);
    }
    sample();
  }

  // How far the scale of one body may change against the other's: rms of u_a - u_b over the samples.
  double spread(std::size_t a, std::size_t b) const {
    return (samples_.row(row(a)) - samples_.row(row(b))).norm() / std::sqrt(static_cast<double>(kSamples));
  }

 private:
  static constexpr Eigen::Index kSamples = 32;
  static constexpr double kError = 1e-3;      // of places in a body, in its size
  static constexpr double kPlacePrior = 100;  // of the shift, in sizes of the body
  static Eigen::Index row(std::size_t body) { return static_cast<Eigen::Index>(body); }

  void describe(const Frames& frames) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const FrameIndex f : frames) sum += state_.frames[f].centre;
    centroid_.emplace_back(sum / static_cast<double>(frames.size()));
    double squares = 0;
    for (const FrameIndex f : frames) squares += (state_.frames[f].centre - centroid_.back()).squaredNorm();
    size_.push_back(std::max(std::sqrt(squares / static_cast<double>(frames.size())), 1e-9));
  }

  void add(Eigen::Index column, double value) { entries_.emplace_back(rows_, column, value); }

  void add_priors(std::size_t body) {
    for (int k = 0; k < 4; ++k, ++rows_) add(4 * row(body) + k, k == 0 ? 1 : 1 / kPlacePrior);
  }

  // The frame has one place: u_a (c - m_a) + s_a t_a = u_b (c - m_b) + s_b t_b.
  void add_joint(FrameIndex frame, std::size_t a, std::size_t b) {
    const double weight = 1 / (kError * std::min(size_[a], size_[b]));
    for (int k = 0; k < 3; ++k, ++rows_)
      for (const auto& [body, sign] : {std::pair(a, 1.0), std::pair(b, -1.0)}) {
        if (body == fixed_) continue;
        add(4 * row(body), sign * weight * (state_.frames[frame].centre - centroid_[body])[k]);
        add(4 * row(body) + 1 + k, sign * weight * size_[body]);
      }
  }

  // With A the rows and z random signs, (A'A)^-1 A'z has the covariance (A'A)^-1.
  void sample() {
    const Eigen::Index columns = 4 * std::ssize(size_);
    for (int k = 0; k < 4; ++k, ++rows_) add(4 * row(fixed_) + k, 1 / kError);  // it does not move
    Eigen::SparseMatrix<double> a(rows_, columns);
    a.setFromTriplets(entries_.begin(), entries_.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(a.transpose() * a);
    samples_.resize(std::ssize(size_), kSamples);
    for (Eigen::Index s = 0; s < kSamples; ++s) {
      Eigen::VectorXd z(rows_);
      std::mt19937_64 random(static_cast<std::uint64_t>(s));
      for (double& value : z) value = random() % 2 == 0 ? 1 : -1;
      const Eigen::VectorXd x = solver.solve(a.transpose() * z);
      for (Eigen::Index b = 0; b < std::ssize(size_); ++b) samples_(b, s) = x[4 * b];
    }
  }

  const Bodies& bodies_;
  const BlockState& state_;
  std::size_t fixed_;
  std::vector<Eigen::Vector3d> centroid_;  // [bodies]
  std::vector<double> size_;               // [bodies] rms distance from the centroid
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::Index rows_ = 0;
  Eigen::MatrixXd samples_;  // [bodies x kSamples] of u
};

std::size_t largest(const Bodies& bodies) {
  std::size_t largest = 0;
  for (std::size_t b = 1; b < bodies.size(); ++b)
    if (bodies.frames(b).size() > bodies.frames(largest).size()) largest = b;
  return largest;
}

// Joins bodies that know each other's scale. The first body stays the first one.
Bodies joined(const Bodies& bodies, const BlockState& state) {
  constexpr double kKnown = 0.1;
  const ScaleChanges changes(bodies, state, largest(bodies));
  DisjointSets sets(static_cast<std::int64_t>(bodies.size()));
  for (std::size_t b = 0; b < bodies.size(); ++b)
    for (const FrameIndex f : bodies.joints(b))
      for (const std::size_t other : bodies.of(f))
        if (other < b && changes.spread(other, b) < kKnown)
          sets.unite(static_cast<std::int64_t>(other), static_cast<std::int64_t>(b));
  std::map<std::int64_t, std::set<FrameIndex>> frames;  // by the first body
  for (std::size_t b = 0; b < bodies.size(); ++b)
    frames[sets.find(static_cast<std::int64_t>(b))].insert(bodies.frames(b).begin(), bodies.frames(b).end());
  Bodies result(state.oriented.size());
  for (const auto& [first, all] : frames) result.add({all.begin(), all.end()});
  return result;
}

}  // namespace

void find_loose_parts(const Block& block, const BlockState& state, const LinkWeights& links, BlockDiagnostics& d) {
  const Frames known = frames_of_known_length(block, state);
  if (std::ssize(known) == std::ranges::count_if(state.oriented, [](std::uint8_t o) { return o != 0; })) return;
  const Bodies of_links = bodies_of_links(GoodLinks(state, links, d.requested.min_link_points), known);
  if (of_links.size() < 2) return;
  const Bodies bodies = joined(of_links, state);
  const std::size_t main = known.size() > 1 ? 0 : largest(bodies);  // the first body has the known lengths
  std::vector<std::size_t> order(bodies.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {},
                           [&](std::size_t b) { return std::pair(b != main, -std::ssize(bodies.frames(b))); });
  constexpr std::int64_t kNone = -2, kMain = -1;
  IndexedVector<FrameIndex, std::int64_t> part_of(state.oriented.size(), kNone);
  for (const std::size_t b : order) {
    const std::int64_t number = b == main ? kMain : std::ssize(d.loose_parts);
    BlockDiagnostics::LoosePart part;
    for (const FrameIndex f : bodies.frames(b)) {
      if (bodies.of(f).size() > 1) part.joints.push_back(f);
      if (part_of[f] != kNone) continue;
      part_of[f] = number;
      part.frames.push_back(f);
    }
    if (b != main && !part.frames.empty()) d.loose_parts.push_back(std::move(part));
  }
  links.visit([&](const FrameEdge& edge) {
    if (!state.oriented[edge.a] || !state.oriented[edge.b] || bodies.share_one(edge.a, edge.b)) return;
    for (const FrameIndex f : {edge.a, edge.b})
      if (part_of[f] >= 0) {
        std::int64_t& points = d.loose_parts[static_cast<std::size_t>(part_of[f])].points;
        points = std::max(points, edge.weight);
      }
  });
  std::erase_if(d.loose_parts, [](const auto& part) { return part.joints.empty() && part.points == 0; });
  std::ranges::stable_sort(d.loose_parts, std::greater(), [](const auto& part) { return part.frames.size(); });
}

}  // namespace megablock
