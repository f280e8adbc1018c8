#include "adjust/tile/lost_frames.h"

#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

constexpr double kThreshold = 32;  // sigmas, as the adjustment asks for

// Vehicles with four cameras. A model whose scale is not yet right: frames and points are `scale` as far apart as they
// should be, the cameras of a rig are not.
struct LostRigs : SingleTile {
  LostRigs(double scale, std::uint64_t seed) : SingleTile(options(seed)), model(truth()) {
    for (Pose& frame : model.frames) frame.centre *= scale;
    for (Eigen::Vector3d& point : model.points) point *= scale;
    std::fill(problem.kept.begin(), problem.kept.end(), 1);
    state = model;
    for (const std::size_t f : lost) {
      state.frames[f].rotation = rotation_update(state.frames[f].rotation, {0.1, 0.3, 1.5});
      state.frames[f].centre += Eigen::Vector3d(10, -20, 5);
      drop_observations_of(f);
    }
  }
  static SimulationOptions options(std::uint64_t seed) {
    SimulationOptions options;
    options.scene = SimulationOptions::Scene::kStreet;
    options.frames = 40;
    options.distortion = options.calibrate = false;
    options.outlier_share = 0.1;
    options.seed = seed;
    return options;
  }
  // What screening leaves of a frame that stands elsewhere.
  void drop_observations_of(std::size_t frame) {
    for (std::size_t row = 0; row < problem.image.size(); ++row)
      if (problem.image[row].valid() &&
          static_cast<std::size_t>(problem.images[problem.image[row].value].frame.value) == frame)
        problem.kept[row] = 0;
  }
  TileState model;
  std::vector<std::size_t> lost{5, 17, 18, 31};
};

TEST(LostFrames, OfRigsInAModelOfAnotherScale) {
  for (const double scale : {1.0, 0.97, 0.9, 1.1}) {
    for (const std::uint64_t seed : {18, 19, 20}) {
      LostRigs tile(scale, seed);
      const std::vector<LocalFrame> found = recover_lost_frames(tile.problem, tile.state, kThreshold);
      double place = 0, turn = 0;
      for (const LocalFrame f : found) {
        const Pose &pose = tile.state.frames[static_cast<std::size_t>(f.value)],
                   &right = tile.model.frames[static_cast<std::size_t>(f.value)];
        place = std::max(place, (pose.centre - right.centre).norm());
        turn = std::max(turn, rotation_angle(pose.rotation, right.rotation) / kDegree);
      }
      EXPECT_EQ(found.size(), tile.lost.size()) << scale;
      // A tenth of the lever arms, over the distances of the points: far less than what an adjustment needs.
      EXPECT_LT(place, 0.05) << scale;
      EXPECT_LT(turn, 0.1) << scale;
    }
  }
}

}  // namespace
}  // namespace megablock
