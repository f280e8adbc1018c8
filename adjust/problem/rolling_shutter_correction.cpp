#include "adjust/problem/rolling_shutter_correction.h"

#include <algorithm>
#include <limits>

#include "geometry/numbers/median.h"

namespace megablock {

std::vector<Motion> tile_motions(const FramePaths& paths, const TileProblem& problem, const TileState& at,
                                 const BlockState& others) {
  const FramePaths::PoseOf in_tile = [&](FrameIndex frame) -> const Pose* {
    const auto found = std::lower_bound(problem.frames.begin(), problem.frames.end(), frame);
    const auto row = static_cast<std::size_t>(found - problem.frames.begin());
    return found != problem.frames.end() && *found == frame ? &at.frames[row] : nullptr;
  };
  const FramePaths::PoseOf in_block = [&](FrameIndex frame) {
    return others.oriented[frame] ? &others.frames[frame] : nullptr;
  };
  std::vector<Motion> motions;
  for (const FrameIndex frame : problem.frames) {
    std::optional<Motion> motion = paths.motion(frame, in_tile);
    if (!motion) motion = paths.motion(frame, in_block);
    motions.push_back(motion.value_or(Motion()));
  }
  return motions;
}

namespace {

// NaN when no point is known.
double median_distance(const TileProblem& problem, const TileState& at) {
  std::vector<double> known;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!at.points[p].allFinite()) continue;
    for (std::int64_t o = problem.begin[p]; o < problem.begin[p + 1]; ++o) {
      if (!problem.image[o].valid()) continue;
      const TileImage& image = problem.images[problem.image[o].value];
      const Pose camera = camera_pose(at.frames[image.frame.value], at.mounts[image.mount]);
      known.push_back((at.points[p] - camera.centre).norm());
    }
  }
  return known.empty() ? std::numeric_limits<double>::quiet_NaN() : median(std::move(known));
}

}  // namespace

std::vector<Readout> tile_readouts(const Block& block, const TileProblem& problem) {
  std::vector<Readout> readouts;
  for (const CameraIndex c : problem.cameras)
    readouts.push_back({block.cameras[c].readout_s, static_cast<double>(block.cameras[c].height)});
  return readouts;
}

void correct_rolling_shutter(const std::vector<Readout>& readouts, const std::vector<Motion>& motions,
                             const TileState& at, TileProblem& problem) {
  const double usual_distance = median_distance(problem, at);
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    const bool tie = problem.points[p].role == PointRole::kTie, known = at.points[p].allFinite();
    for (std::int64_t o = problem.begin[p]; o < problem.begin[p + 1]; ++o) {
      if (!problem.image[o].valid()) continue;
      const TileImage& image = problem.images[problem.image[o].value];
      const Readout& readout = readouts[image.camera.value];
      if (readout.time_s == 0) continue;
      const MovingView view{at.cameras[image.camera.value], at.frames[image.frame.value], at.mounts[image.mount],
                            motions[image.frame.value], readout};
      const Eigen::Vector2d measured(problem.x[o], problem.y[o]);
      const Eigen::Vector2d pixel =
          known ? measured - rolling_shift(view, at.points[p]) : still_pixel(view, measured, usual_distance);
      if (!pixel.allFinite()) continue;
      problem.x[o] = tie ? from_fixed_pixel(to_fixed_pixel(pixel.x())) : pixel.x();
      problem.y[o] = tie ? from_fixed_pixel(to_fixed_pixel(pixel.y())) : pixel.y();
    }
  }
}

}  // namespace megablock
