// Evaluates the robust losses rho(s) of the squared norm s = |r|^2, in sigmas, with c the scale:
//
//     Huber          s up to c^2,   2 c sqrt(s) - c^2 beyond                    rho' = c / sqrt(s)
//     Cauchy         c^2 log(1 + s / c^2)                                        rho' = 1 / (1 + s / c^2)
//     Cauchy's tail  Huber up to 4 c^2,   3 c^2 + 2 c^2 log(s / 4 c^2) beyond    rho' = 2 c^2 / s
//
// Value and slope are continuous at every corner: at s = 4 c^2 both parts of the last one have rho = 3 c^2 and rho' =
// 1/2. rho' is the weight of an observation. rho'' is negative for all of them beyond the corner.
#include "adjust/problem/tile_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "adjust/problem/owner.h"
#include "io/base/error.h"
#include "io/text/plausible.h"

namespace megablock {

std::array<double, 3> RobustLoss::evaluate_beyond(double squared_norm) const {
  const double s = squared_norm, b = scale * scale, end_of_line = 4 * b;  // for Cauchy's tail
  // Ceres holds the first derivative above zero in the same way. A weight of zero would take the observation out of the
  // normal equations.
  constexpr double kTiny = std::numeric_limits<double>::min();
  if (kind == Kind::kHuber || (kind == Kind::kCauchyTail && s <= end_of_line)) {
    const double r = std::sqrt(s);
    const double first = std::max(kTiny, scale / r);
    return {2 * scale * r - b, first, -first / (2 * s)};
  }
  if (kind == Kind::kCauchyTail) {
    const double first = 2 * b / s;
    return {b * (3 + 2 * std::log(s / end_of_line)), std::max(kTiny, first), -first / s};
  }
  const double sum = 1 + s / b, inverse = 1 / sum;  // Cauchy
  return {b * std::log(sum), std::max(kTiny, inverse), -inverse * inverse / b};
}

// One ray determines two coordinates of a point. The prior of a control point may determine the third.
bool TileProblem::active(std::int64_t point) const {
  int count = 0;
  for (std::int64_t row = begin[point]; row < begin[point + 1]; ++row) {
    count += kept[row] != 0;
    if (count >= 2) return true;
  }
  return count == 1 && points[point].role == PointRole::kControl;
}

void ObservationOptions::check() const {
  require_within(image_sigma_px, kSigmaPx, "image_sigma_px");
  require_within(image_loss.scale, kInSigmas, "image_loss_scale");
  require_within(position_loss.scale, kInSigmas, "position_loss_scale");
  require_within(control_loss.scale, kInSigmas, "control_loss_scale");
  require_within(attitude_loss.scale, kInSigmas, "attitude_loss_scale");
  require_within(relative_loss.scale, kInSigmas, "relative_loss_scale");
  require_within(line_loss.scale, kInSigmas, "line_loss_scale");
  require_within(vertical_loss.scale, kInSigmas, "vertical_loss_scale");
}

// The images count, and not the frames: a frame that sees the point with three cameras has three candidates.
TileIndex owner_tile(const Block& block, const Tiles& tiles, const ImageIndex* begin, const ImageIndex* end) {
  std::vector<OwnerCandidate> candidates;
  candidates.reserve(static_cast<std::size_t>(end - begin));
  for (const ImageIndex* image = begin; image != end; ++image) {
    const FrameIndex frame = block.images[*image].frame;
    const TileIndex tile = tiles.tile_of_frame[frame];
    if (tile.valid()) candidates.push_back({tile.value, tiles.depth_of(frame)});
  }
  return TileIndex(owner_part(candidates));
}

TileIndex owner_tile(const Tiles& tiles, FrameIndex first, FrameIndex second) {
  const TileIndex a = tiles.tile_of_frame[first], b = tiles.tile_of_frame[second];
  if (!a.valid() || !b.valid()) return TileIndex();
  std::vector<OwnerCandidate> candidates = {{a.value, tiles.depth_of(first)}, {b.value, tiles.depth_of(second)}};
  return TileIndex(owner_part(candidates));
}

Tiles single_tile(const Block& block) {
  Tiles tiles;
  tiles.tile_count = 1;
  tiles.tile_of_frame.assign(block.frames.size(), TileIndex(0));
  tiles.component.assign(block.frames.size(), 0);
  tiles.tree.nodes.resize(1);
  tiles.tree.nodes[0].tile = TileIndex(0);
  return tiles;
}

std::int64_t frame_of_point(const TileProblem& problem, std::int64_t point) {
  for (std::int64_t row = problem.begin[point]; row < problem.begin[point + 1]; ++row)
    if (problem.kept[row]) return problem.images[problem.image[row].value].frame.value;
  return -1;
}

// Only lower rows are compared, so that one pair of mounts does not count twice. 1e-9 m tells mounts at the same place,
// whose distance says nothing of the scale.
bool rig_gives_scale(const TileProblem& problem, const TileState& state, std::size_t mount) {
  if (problem.mount_free[mount]) return false;
  for (std::size_t other = 0; other < mount; ++other)
    if (problem.mounts[other].rig == problem.mounts[mount].rig && !problem.mount_free[other] &&
        (state.mounts[other].centre - state.mounts[mount].centre).norm() > 1e-9)
      return true;
  return false;
}

TileState make_tile_state(const TileProblem& problem, const BlockState& state, std::vector<Eigen::Vector3d> points) {
  if (points.size() != problem.points.size())
    throw InputError("the tile has " + std::to_string(problem.points.size()) + " points, values were given for " +
                     std::to_string(points.size()));
  TileState tile;
  for (FrameIndex frame : problem.frames) tile.frames.push_back(state.frames[frame]);
  for (CameraIndex camera : problem.cameras) tile.cameras.push_back(state.cameras[camera]);
  for (const MountId& id : problem.mounts)
    tile.mounts.push_back(state.mounts[id.rig][static_cast<std::size_t>(id.mount)]);
  tile.points = std::move(points);
  return tile;
}

void store_tile_state(const TileProblem& problem, const TileState& tile, BlockState& state) {
  for (std::size_t f = 0; f < problem.frames.size(); ++f) state.frames[problem.frames[f]] = tile.frames[f];
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) state.cameras[problem.cameras[c]] = tile.cameras[c];
  for (std::size_t m = 0; m < problem.mounts.size(); ++m)
    state.mounts[problem.mounts[m].rig][static_cast<std::size_t>(problem.mounts[m].mount)] = tile.mounts[m];
}

}  // namespace megablock
