// Falsifies the observations that a tile has of two separator frames, which the seam check must find.
#pragma once

#include <algorithm>
#include <array>

#include "geometry/camera/camera.h"
#include "geometry/transform/rotation.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {

// Observations of a frame in a tile.
inline std::int64_t observations_of(const TileProblem& problem, FrameIndex frame) {
  return std::count_if(problem.image.begin(), problem.image.end(), [&](LocalImage image) {
    return problem.frames[problem.images[image.value].frame.value] == frame;
  });
}

// A tile's two frames with most observations on the side (the tile, or one of the others) that has fewer of them.
struct SharedFrames {
  std::array<FrameIndex, 2> frames;
  std::int64_t observations = 0;  // of the second, on that side
};
inline SharedFrames most_shared_frames(const TiledBlock& block, std::size_t tile) {
  std::vector<std::pair<std::int64_t, FrameIndex>> shared;
  for (const FrameIndex frame : block.problems[tile].frames) {
    std::int64_t elsewhere = 0;
    for (std::size_t t = 0; t < block.problems.size(); ++t)
      if (t != tile) elsewhere = std::max(elsewhere, observations_of(block.problems[t], frame));
    shared.emplace_back(std::min(observations_of(block.problems[tile], frame), elsewhere), frame);
  }
  std::sort(shared.rbegin(), shared.rend());
  return {{shared[0].second, shared[1].second}, shared[1].first};
}

// Moves the measurements that `problem` holds of a frame to where they were, had it been turned.
inline void turn_frame(const TiledBlock& block, FrameIndex frame, const Eigen::Vector3d& turn, TileProblem& problem) {
  const BlockState& truth = block.simulated.truth;
  Pose turned = truth.frames[frame];
  turned.rotation = rotation_update(turned.rotation, turn);
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    for (std::int64_t o = problem.begin[p]; o < problem.begin[p + 1]; ++o) {
      const TileImage& image = problem.images[problem.image[o].value];
      if (problem.frames[image.frame.value] != frame || problem.points[p].role != PointRole::kTie) continue;
      const Eigen::Vector3d& ground = block.simulated.points[problem.points[p].index];
      const Intrinsics& camera = truth.cameras[problem.cameras[image.camera.value]];
      const Pose& mount = truth.mounts[problem.mounts[image.mount].rig][problem.mounts[image.mount].mount];
      const Eigen::Vector2d before = project(camera, to_camera(truth.frames[frame], mount, ground)),
                            after = project(camera, to_camera(turned, mount, ground));
      problem.x[o] += after.x() - before.x();
      problem.y[o] += after.y() - before.y();
    }
}

}  // namespace megablock
