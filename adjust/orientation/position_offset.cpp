#include "adjust/orientation/position_offset.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "adjust/orientation/steps/control_marks.h"
#include "geometry/numbers/median.h"
#include "io/block/held_priors.h"
#include "io/block/observed_poses.h"

namespace megablock {

namespace {

constexpr std::size_t kFewestPoints = 3;
constexpr double kOfOwnSigma = 3, kOfPosition = 5, kOfScatter = 3;  // times these an offset counts
constexpr double kNormal = 1.4826, kOfMedian = 1.2533;              // sigma over median of |r|; sigma of a median
constexpr double kControlDecides = 3;                               // sigmas of the offset
constexpr double kKnown = kUnknownHeightSigma / 2;                  // metres

bool has_position(const Block& block, const BlockState& state, FrameIndex frame) {
  return state.oriented[frame] && block.frames[frame].position_prior.has_value();
}

// What the control points say of one coordinate.
struct Comparison {
  std::vector<double> differences, control_sigmas, views;  // metres; views: from the cameras to the point
};

struct Difference {
  double offset = 0, scatter = 0, sigma = 0;
};

// The median, and its sigma where each difference has at least `least_sigma`.
Difference median_difference(const std::vector<double>& differences, double least_sigma) {
  Difference found;
  found.offset = median(differences);
  std::vector<double> rest;
  for (const double d : differences) rest.push_back(std::abs(d - found.offset));
  found.scatter = kNormal * median(std::move(rest));
  found.sigma = kOfMedian * std::max(found.scatter, least_sigma) / std::sqrt(static_cast<double>(differences.size()));
  return found;
}

Difference difference_of(const Comparison& c, double focal_share) {
  Difference found = median_difference(c.differences, median(c.control_sigmas));
  found.sigma = std::hypot(found.sigma, median(c.views) * focal_share);
  return found;
}

bool counts(const Difference& d, double position_sigma) {
  return std::abs(d.offset) > std::max({kOfOwnSigma * d.sigma, kOfPosition * position_sigma, kOfScatter * d.scatter});
}

// The prior sigma of the focal length over itself, the largest of the cameras that see control.
double focal_share_of(const Block& block) {
  double share = 0;
  for (const ControlPoint& point : block.control_points)
    for (const ImageMeasurement& mark : point.measurements) {
      const Camera& camera = block.cameras[block.camera_of(mark.image)];
      share = std::max(share, camera.prior_sigma[kFocal] / camera.intrinsics[kFocal]);
    }
  return share;
}

Eigen::Vector3d mean_centre(const std::vector<PointView>& marks) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const PointView& mark : marks) sum += mark.camera.centre;
  return sum / static_cast<double>(marks.size());
}

// "46.90 m above", "2.00 m west of and 3.00 m below".
std::string where_of(const Eigen::Vector3d& offset) {
  constexpr std::array<std::array<const char*, 2>, 3> kSides{
      {{"east of", "west of"}, {"north of", "south of"}, {"above", "below"}}};
  std::vector<std::string> parts;
  for (int k = 0; k < 3; ++k)
    if (offset[k] != 0)
      parts.push_back(
          fmt::format("{:.2f} m {}", std::abs(offset[k]), kSides[static_cast<std::size_t>(k)][offset[k] < 0 ? 1 : 0]));
  std::string where = parts.front();
  for (std::size_t i = 1; i < parts.size(); ++i) where += (i + 1 == parts.size() ? " and " : ", ") + parts[i];
  return where;
}

}  // namespace

std::optional<PositionOffset> find_position_offset(const Block& block, const BlockState& state,
                                                   const std::vector<FrameIndex>& frames) {
  std::array<std::vector<double>, 3> position_sigmas;
  std::array<Comparison, 3> compared;
  for (const FrameIndex frame : frames) {
    if (!has_position(block, state, frame)) continue;
    const PositionPrior& prior = *block.frames[frame].position_prior;
    if (held(prior)) return std::nullopt;
    for (std::size_t k = 0; k < 3; ++k)
      if (const double sigma = prior.sigma[static_cast<int>(k)]; sigma < kKnown) position_sigmas[k].push_back(sigma);
  }
  for (const ControlPoint& point : block.control_points) {
    if (point.role != PointRole::kControl) continue;
    const SeenMarks seen = see_marks(block, state, frames, point);
    if (!seen.place) continue;
    const Eigen::Vector3d view = *seen.place - mean_centre(seen.marks);
    for (int k = 0; k < 3; ++k) {
      if (!std::isfinite(point.position[k]) || !(point.sigma[k] < kKnown)) continue;
      Comparison& c = compared[static_cast<std::size_t>(k)];
      c.differences.push_back((*seen.place)[k] - point.position[k]);
      c.control_sigmas.push_back(point.sigma[k]);
      c.views.push_back(view[k]);
    }
  }
  const double focal_share = focal_share_of(block);
  PositionOffset found;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const auto count = static_cast<double>(position_sigmas[axis].size());
    if (compared[axis].differences.size() < kFewestPoints || position_sigmas[axis].empty()) continue;
    const Difference d = difference_of(compared[axis], focal_share);
    const double sigma = median(position_sigmas[axis]);
    if (!counts(d, sigma)) continue;
    found.offset[k] = d.offset;
    found.sigma[k] = d.sigma;
    found.before[k] = sigma;
    found.after[k] = std::hypot(sigma, kControlDecides * d.sigma * std::sqrt(count));
    found.points = std::max(found.points, std::ssize(compared[axis].differences));
  }
  if (found.offset.isZero(0)) return std::nullopt;
  return found;
}

void remove_offset(const PositionOffset& offset, const std::vector<FrameIndex>& frames,
                   IndexedVector<FrameIndex, Frame>& positions, BlockState& state) {
  for (const FrameIndex frame : frames) {
    if (state.oriented[frame]) state.frames[frame].centre -= offset.offset;
    auto& prior = positions[frame].position_prior;
    if (!prior) continue;
    prior->position -= offset.offset;
    const Eigen::Vector3d raised = (offset.after.cwiseAbs2() - offset.before.cwiseAbs2()).cwiseMax(0);
    prior->sigma = (prior->sigma.cwiseAbs2() + raised).cwiseSqrt();
  }
}

PositionOffset adjusted_offset(const MovedPositions& moved, const Block& block, const BlockState& adjusted,
                               const IndexedVector<FrameIndex, Eigen::Vector3d>& variances) {
  PositionOffset found = moved.offset;
  std::array<std::vector<double>, 3> differences, own;  // given minus adjusted; variances
  for (const FrameIndex frame : moved.frames) {
    if (!has_position(block, adjusted, frame)) continue;
    const RigIndex rig = block.frames[frame].rig;
    const Eigen::Vector3d d = difference(
        adjusted.frames[frame], corrected(*block.frames[frame].position_prior, block.rigs[rig], adjusted.mounts[rig]));
    for (std::size_t k = 0; k < 3; ++k) {
      differences[k].push_back(-d[static_cast<int>(k)]);
      own[k].push_back(variances[frame][static_cast<int>(k)]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    if (found.offset[k] == 0 || differences[axis].empty()) continue;
    const Difference d = median_difference(differences[axis], 0);
    found.offset[k] += d.offset;
    found.sigma[k] = std::sqrt(d.sigma * d.sigma + median(own[axis]));
  }
  return found;
}

std::string offset_text(const PositionOffset& found) {
  const bool of_heights = found.offset.head<2>().isZero(0);
  return fmt::format(
      "the positions lie {} the control points (sigma {:.2f} m, {} points): {}; they are moved onto the control, and "
      "their sigmas are raised from {:.2g} to {:.2g} m, so that they do not count the control a second time "
      "('orientation: {{move_positions_to_control: false}}' leaves them)",
      where_of(found.offset), found.sigma.maxCoeff(), found.points,
      of_heights ? "ellipsoidal and orthometric heights, or local control about another origin?"
                 : "coordinates of two systems?",
      found.before.maxCoeff(), found.after.maxCoeff());
}

std::string adjusted_offset_text(const PositionOffset& found) {
  return fmt::format("in the adjusted block the positions lie {} the control points (sigma {:.2g} m)",
                     where_of(found.offset), found.sigma.maxCoeff());
}

}  // namespace megablock
