// Which angles does a similarity from the centres of frames to known positions determine? Positions in all directions
// determine three; positions on one line leave the rotation about it open, and their noise alone would choose it. With
// the similarity (s, R, t), the axis a of the line and what is known of the angles, R becomes
//
//     kAll     the first axes are those of the ground: R without its twist about R'a
//     kLevel   the rotation about the vertical that brings the line to its direction; off a line, the twist of R about
//              the vertical
//     kNone    R turned about a until the direction that should be down is as low as it can be
//
// The shift is chosen anew so that the centroid of the positions stays in place.
#include "adjust/orientation/steps/ground_alignment.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"

namespace megablock {

namespace {

// The part of a rotation that is not about the axis (swing of the swing-twist decomposition).
Eigen::Quaterniond without_twist(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& axis) {
  const double along = rotation.vec().dot(axis);
  const Eigen::Quaterniond twist(rotation.w(), along * axis.x(), along * axis.y(), along * axis.z());
  if (!(twist.norm() > 1e-9)) return rotation;
  return rotation * twist.normalized().conjugate();
}

struct KnownPositions {
  std::vector<Eigen::Vector3d> from, to;
  std::vector<double> sigma;  // allows for the bend of first centres
  double stated_sigma = 0;    // mean of the priors
};

constexpr double kFits = 4;  // sigmas

bool fits(const KnownPositions& known, std::size_t i, const Similarity& similarity) {
  return (similarity(known.from[i]) - known.to[i]).norm() <= kFits * known.sigma[i];
}

// The centres of oriented frames and the positions that are known of them, with sigmas that allow for the bend of the
// first centres over the block: a twentieth of the median distance from its middle, in squares with the stated sigma.
KnownPositions known_positions(const OrientationGraph& graph, const OrientationValues& values) {
  KnownPositions known;
  for (std::size_t f = 0; f < graph.frames.size(); ++f) {
    const auto& node = graph.frames[f];
    if (!values.frames[f] || !node.position) continue;
    known.from.push_back(values.frames[f]->centre);
    known.to.push_back(node.position->position);
    known.sigma.push_back(node.position->sigma.mean());
    known.stated_sigma += node.position->sigma.mean();
  }
  if (known.to.empty()) return known;
  known.stated_sigma /= static_cast<double>(known.to.size());
  // First centres are bent over the block. The sigmas allow for a twentieth of its (robust) extent.
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> coordinates;
    for (const auto& p : known.to) coordinates.push_back(p[axis]);
    middle[axis] = median(std::move(coordinates));
  }
  std::vector<double> distances;
  for (const auto& p : known.to) distances.push_back((p - middle).norm());
  const double bend = 0.05 * median(std::move(distances));
  for (double& sigma : known.sigma) sigma = std::hypot(sigma, bend);
  return known;
}

}  // namespace

MeanAxes mean_axes(const OrientationGraph& graph, const OrientationValues& values) {
  MeanAxes result;
  double count = 0;
  for (std::size_t i = 0; i < graph.images.size(); ++i) {
    const auto camera = values.camera(graph, static_cast<std::int32_t>(i));
    if (!camera) continue;
    result.view += camera->rotation.conjugate() * Eigen::Vector3d::UnitZ();
    result.down += camera->rotation.conjugate() * Eigen::Vector3d::UnitY();
    ++count;
  }
  if (count > 0) result.view /= count, result.down /= count;
  return result;
}

GroundAngles known_angles(const OrientationGraph& graph) {
  for (const auto& frame : graph.frames)
    if (frame.given || frame.attitude) return GroundAngles::kAll;
  // One or two verticals could be wrong without any contradiction.
  constexpr std::ptrdiff_t kVerticals = 3;
  const auto seen = std::count_if(graph.images.begin(), graph.images.end(),
                                  [](const auto& image) { return image.vertical != nullptr; });
  return seen >= kVerticals ? GroundAngles::kLevel : GroundAngles::kNone;
}

std::optional<AxisDirection> down_by_positions(const OrientationGraph& graph, const OrientationValues& values,
                                               const Eigen::Vector3d& down) {
  const KnownPositions known = known_positions(graph, values);
  const auto similarity = fit_similarity_robust(known.from, known.to, known.sigma);
  if (!similarity) return std::nullopt;
  std::vector<double> weights;
  for (std::size_t i = 0; i < known.to.size(); ++i) {
    const double residual = ((*similarity)(known.from[i]) - known.to[i]).norm();
    weights.push_back(1 /
                      (static_cast<double>(known.to.size()) * (known.sigma[i] * known.sigma[i] + residual * residual)));
  }
  const auto covariance = similarity_covariance(*similarity, known.from, weights);
  if (!covariance) return std::nullopt;
  const Eigen::Vector3d here = similarity->rotation.conjugate() * down;
  // here = R' down. R Exp(w) changes it by [here]x w.
  const Eigen::Matrix3d by_turn = skew(here);
  return AxisDirection{here, by_turn * covariance->topLeftCorner<3, 3>() * by_turn.transpose()};
}

std::optional<Similarity> similarity_to_ground(const OrientationGraph& graph, const OrientationValues& values,
                                               double median_distance, GroundAngles known_angles) {
  const KnownPositions known = known_positions(graph, values);
  auto similarity = fit_similarity_robust(known.from, known.to, known.sigma);
  if (!similarity) return std::nullopt;

  // The spread of the positions that agree. They lie on a line when nothing across it exceeds their noise.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double count = 0;
  for (int pass = 0; pass < 2; ++pass)
    for (std::size_t i = 0; i < known.to.size(); ++i) {
      if (!fits(known, i, *similarity)) continue;
      const Eigen::Vector3d moved = (*similarity)(known.from[i]);
      if (pass == 0)
        mean += moved, ++count;
      else
        spread += (moved - mean / count) * (moved - mean / count).transpose() / count;
    }
  if (count < 2) return std::nullopt;
  const SymmetricEigen3 eigen = symmetric_eigen3(spread);
  const double length = std::sqrt(std::max(0.0, eigen.values(2)));
  const double width = std::sqrt(std::max(0.0, eigen.values(1)));
  // The width of a line of n positions is its noise. A noise of sigma gives a mean width with an error of sigma /
  // sqrt(n); twice that is significant.
  const bool line = count < 3 || width < std::max(0.03 * length, 2 * known.stated_sigma / std::sqrt(count));
  if (!line && known_angles != GroundAngles::kLevel) return similarity;

  const Eigen::Vector3d axis = eigen.vectors.col(2), up = Eigen::Vector3d::UnitZ();
  Eigen::Quaterniond rotation;
  if (known_angles == GroundAngles::kLevel) {
    rotation = line ? turn_about(up, similarity->rotation.conjugate() * axis, axis)
                    : without_twist(similarity->rotation, up).conjugate() * similarity->rotation;
  } else if (known_angles == GroundAngles::kAll) {
    // The left factor about the axis is the rotation that the positions leave open. It is removed from the rotation.
    rotation = without_twist(similarity->rotation, similarity->rotation.conjugate() * axis);
  } else {
    const double distance = similarity->scale * median_distance;
    MeanAxes axes = mean_axes(graph, values);
    axes.view = similarity->rotation * axes.view;
    axes.down = similarity->rotation * axes.down;
    const Eigen::Vector3d down = which_points_down(axes, axis, distance);
    rotation = turn_about(axis, down, -Eigen::Vector3d::UnitZ()) * similarity->rotation;
  }
  const Eigen::Vector3d centre = mean / count;  // on the line, so that it stays in place
  const Eigen::Vector3d before = similarity->inverse()(centre);
  similarity->rotation = rotation.normalized();
  similarity->translation = centre - similarity->scale * (similarity->rotation * before);
  return similarity;
}

double share_that_fits(const OrientationGraph& graph, const OrientationValues& values, const Similarity& to_ground) {
  const KnownPositions known = known_positions(graph, values);
  if (known.to.empty()) return 0;
  double count = 0;
  for (std::size_t i = 0; i < known.to.size(); ++i) count += fits(known, i, to_ground);
  return count / static_cast<double>(known.to.size());
}

Similarity similarity_to_free_frame(const OrientationGraph& graph, const OrientationValues& values, GroundAngles known,
                                    bool keep_scale) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double count = 0;
  for (const auto& frame : values.frames)
    if (frame) mean += frame->centre, ++count;
  if (count < 2) return {};
  mean /= count;

  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Eigen::Vector3d farthest = Eigen::Vector3d::Zero();
  for (const auto& frame : values.frames) {
    if (!frame) continue;
    const Eigen::Vector3d d = frame->centre - mean;
    spread += d * d.transpose();
    // Of frames that are equally far the first one stays, whatever the rounding.
    if (d.squaredNorm() > farthest.squaredNorm() * (1 + 1e-6)) farthest = d;
  }
  double baselines = 0, links = 0;
  for (const auto& edge : graph.edges) {
    const auto& a = values.frames[static_cast<std::size_t>(graph.images[static_cast<std::size_t>(edge.a)].frame)];
    const auto& b = values.frames[static_cast<std::size_t>(graph.images[static_cast<std::size_t>(edge.b)].frame)];
    if (a && b) baselines += (a->centre - b->centre).norm(), ++links;
  }

  // The mean baseline between linked frames becomes one unit: a free block has no metre.
  Similarity result;
  if (!keep_scale && baselines > 0) result.scale = links / baselines;
  if (known != GroundAngles::kAll) {
    const SymmetricEigen3 eigen = symmetric_eigen3(spread);
    const MeanAxes axes = mean_axes(graph, values);
    const bool line = eigen.values(1) < 1e-3 * eigen.values(2);
    // The normal of the plane of the centres is up or down. Images look down or have y downwards, which tells the two
    // apart. Centres on a line have no plane; up is then against the mean y axis, at right angles to the line.
    Eigen::Vector3d up = line ? Eigen::Vector3d(-axes.down) : Eigen::Vector3d(eigen.vectors.col(0));
    if (up.dot(axes.view + axes.down) > 0) up = -up;
    Eigen::Vector3d east = farthest.normalized();
    up = (up - east * east.dot(up)).normalized();
    if (!line) {
      up = eigen.vectors.col(0) * (eigen.vectors.col(0).dot(axes.view + axes.down) > 0 ? -1.0 : 1.0);
      east = (east - up * up.dot(east)).normalized();
    }
    if (known == GroundAngles::kLevel) {
      up = Eigen::Vector3d::UnitZ();
      east = (farthest - up * farthest.z()).normalized();
    }
    if (up.allFinite() && east.norm() > 0.5) {  // not for centres one above the other
      Eigen::Matrix3d rotation;
      rotation << east.transpose(), up.cross(east).transpose(), up.transpose();
      result.rotation = Eigen::Quaterniond(rotation).normalized();
    }
  }
  result.translation = -result.scale * (result.rotation * mean);
  return result;
}

}  // namespace megablock
