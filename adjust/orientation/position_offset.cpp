#include "adjust/orientation/position_offset.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "adjust/orientation/steps/control_marks.h"
#include "geometry/numbers/median.h"
#include "geometry/similarity/similarity.h"
#include "io/block/held_priors.h"
#include "io/block/observed_poses.h"
#include "io/text/side_text.h"

namespace megablock {

namespace {

constexpr std::size_t kFewestPoints = 3;
constexpr double kOfOwnSigma = 3, kOfScatter = 3;       // times these an offset counts
constexpr double kCommon = 2, kOfPlace = 4;             // of the limit: times u_k and times the root of D_kk
constexpr double kOnALine = 5;                          // times u_k in its place
constexpr double kNormal = 1.4826, kOfMedian = 1.2533;  // sigma over median of |r|; sigma of a median
constexpr double kLoose = 10;  // lengths of an offset: the sigma of a shift that shall tell nothing
constexpr double kKnown = kUnknownHeightSigma / 2;  // metres

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

// The median of the differences, and its sigma where each has at least that of the control.
Difference difference_of(const Comparison& c, double focal_share) {
  Difference found;
  found.offset = median(c.differences);
  std::vector<double> rest;
  for (const double d : c.differences) rest.push_back(std::abs(d - found.offset));
  found.scatter = kNormal * median(std::move(rest));
  const double of_one = std::max(found.scatter, median(c.control_sigmas));
  found.sigma = std::hypot(kOfMedian * of_one / std::sqrt(static_cast<double>(c.differences.size())),
                           median(c.views) * focal_share);
  return found;
}

bool counts(const Difference& d, double place_limit) {
  return std::abs(d.offset) > std::max({kOfOwnSigma * d.sigma, kOfScatter * d.scatter, place_limit});
}

// The observed positions, and what they say of the place of the block.
struct Placed {
  std::vector<Eigen::Vector3d> centres;
  std::vector<double> weights;  // by the largest sigma of each: mostly that of the height, which tilts the block
  std::array<std::vector<double>, 3> sigmas;

  void add(const Eigen::Vector3d& centre, const Eigen::Vector3d& sigma) {
    for (int k = 0; k < 3; ++k)
      if (sigma[k] < kKnown) sigmas[static_cast<std::size_t>(k)].push_back(sigma[k]);
    if (!(sigma.maxCoeff() < kKnown)) return;
    centres.push_back(centre);
    weights.push_back(1 / (sigma.maxCoeff() * sigma.maxCoeff()));
  }
  // The limits p of a place. Positions on a line leave the tilt to other observations.
  Eigen::Vector3d limit_at(const Eigen::Vector3d& place) const {
    std::vector<Eigen::Vector3d> from_place;
    for (const Eigen::Vector3d& centre : centres) from_place.push_back(centre - place);
    const auto covariance = similarity_covariance(Similarity(), from_place, weights);
    Eigen::Vector3d limit;
    for (int k = 0; k < 3; ++k) {
      const double one = median(sigmas[static_cast<std::size_t>(k)]);
      limit[k] = covariance ? kCommon * one + kOfPlace * std::sqrt((*covariance)(4 + k, 4 + k)) : kOnALine * one;
    }
    return limit;
  }
};

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

}  // namespace

std::optional<PositionOffset> find_position_offset(const Block& block, const BlockState& state,
                                                   const std::vector<FrameIndex>& frames) {
  Placed placed;
  std::array<Comparison, 3> compared;
  std::array<std::vector<double>, 3> places;  // of the control
  for (const FrameIndex frame : frames) {
    if (!has_position(block, state, frame)) continue;
    const PositionPrior& prior = *block.frames[frame].position_prior;
    if (held(prior)) return std::nullopt;
    placed.add(state.frames[frame].centre, prior.sigma);
  }
  for (const ControlPoint& point : block.control_points) {
    if (point.role != PointRole::kControl) continue;
    const SeenMarks seen = see_marks(block, state, frames, point);
    if (!seen.place) continue;
    const Eigen::Vector3d view = *seen.place - mean_centre(seen.marks);
    for (int k = 0; k < 3; ++k) {
      places[static_cast<std::size_t>(k)].push_back((*seen.place)[k]);
      if (!std::isfinite(point.position[k]) || !(point.sigma[k] < kKnown)) continue;
      Comparison& c = compared[static_cast<std::size_t>(k)];
      c.differences.push_back((*seen.place)[k] - point.position[k]);
      c.control_sigmas.push_back(point.sigma[k]);
      c.views.push_back(view[k]);
    }
  }
  const double focal_share = focal_share_of(block);
  const Eigen::Vector3d limit = placed.limit_at({median(places[0]), median(places[1]), median(places[2])});
  PositionOffset found;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    if (compared[axis].differences.size() < kFewestPoints || placed.sigmas[axis].empty()) continue;
    const Difference d = difference_of(compared[axis], focal_share);
    if (!counts(d, limit[k])) continue;
    found.offset[k] = d.offset;
    found.sigma[k] = d.sigma;
    found.points = std::max(found.points, std::ssize(compared[axis].differences));
  }
  if (found.offset.isZero(0)) return std::nullopt;
  return found;
}

namespace {

// A group may have positions in another part of the block, which keep their shift: those of `frames` then become a
// group of their own.
void shift_group(const PositionOffset& offset, const std::vector<FrameIndex>& frames, const ShiftAxes& axes,
                 Block& block, BlockState& state) {
  const RigIndex before = block.frames[frames.front()].position_prior->group;
  const auto is_member = [&](const Frame& frame) {
    return frame.position_prior && frame.position_prior->group == before;
  };
  RigIndex group = before;
  if (std::ranges::count_if(block.frames, is_member) > std::ssize(frames)) {
    group = block.rigs.next_index();
    block.rigs.push_back(block.rigs[before]);
    block.rigs[group].name += " in part " + std::to_string(group.value);
    state.mounts.push_back(state.mounts[before]);
  }
  Mount& mount = block.rigs[group].mounts.front();
  mount.pose.centre += offset.offset;
  mount.position_sigma_m = std::hypot(mount.position_sigma_m, kLoose * offset.offset.norm());
  state.mounts[group].front().centre += offset.offset;
  for (const FrameIndex frame : frames) {
    PositionPrior& prior = *block.frames[frame].position_prior;
    prior.group = group;
    prior.shifted = prior.shifted.cwiseMax(axes);
  }
}

}  // namespace

void shift_positions(const PositionOffset& offset, const std::vector<FrameIndex>& frames, Block& block,
                     BlockState& state) {
  std::map<RigIndex, std::vector<FrameIndex>> by_group;
  for (const FrameIndex frame : frames) {
    if (state.oriented[frame]) state.frames[frame].centre -= offset.offset;
    if (const auto& prior = block.frames[frame].position_prior) by_group[prior->group].push_back(frame);
  }
  const ShiftAxes axes = (offset.offset.array() != 0).cast<std::uint8_t>();
  for (const auto& [group, members] : by_group)
    if (group.valid())
      shift_group(offset, members, axes, block, state);
    else
      add_position_group(members, offset.offset, axes, block, state);
}

void add_position_group(const std::vector<FrameIndex>& frames, const Eigen::Vector3d& offset, const ShiftAxes& axes,
                        Block& block, BlockState& state) {
  const RigIndex group = block.rigs.next_index();
  for (const FrameIndex frame : frames) {
    PositionPrior& prior = *block.frames[frame].position_prior;
    prior.group = group;
    prior.shifted = axes;
  }
  std::string name = block.frames[frames.front()].name;
  if (frames.size() > 1) name += fmt::format(" and {} more", frames.size() - 1);
  block.rigs.push_back(position_group("positions of " + name, offset, kLoose * offset.norm()));
  state.mounts.push_back({block.rigs[group].mounts.front().pose});
}

std::string offset_text(const PositionOffset& found) {
  const bool of_heights = found.offset.head<2>().isZero(0);
  return fmt::format(
      "the positions lie {} the control points (sigma {:.2f} m, {} points): {}; their shift is an unknown of the "
      "adjustment ('orientation: {{shift_positions: false}}' leaves them), and the control gives the datum",
      side_text(found.offset), found.sigma.maxCoeff(), found.points,
      of_heights ? "ellipsoidal and orthometric heights, or local control about another origin?"
                 : "coordinates of two systems?");
}

}  // namespace megablock
