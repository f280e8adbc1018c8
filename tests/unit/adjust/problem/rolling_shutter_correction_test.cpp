#include "adjust/problem/rolling_shutter_correction.h"

#include <gtest/gtest.h>

#include "adjust/tile/rolling_start.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

SimulationOptions flight(SimulationOptions::Scene scene) {
  SimulationOptions options = SimulationOptions::of(scene);
  options.frames = 30;
  options.readout_ms = 30;
  options.image_noise_px = 0;
  return options;
}

double rms_residual(const TileProblem& problem, const TileState& at) {
  double sum = 0;
  std::int64_t count = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    for (std::int64_t o = problem.begin[p]; o < problem.begin[p + 1]; ++o, ++count) {
      const TileImage& image = problem.images[problem.image[o].value];
      const Eigen::Vector2d seen =
          project(at.cameras[image.camera.value],
                  to_camera(at.frames[image.frame.value], at.mounts[image.mount], at.points[p]));
      sum += (seen - Eigen::Vector2d(problem.x[o], problem.y[o])).squaredNorm();
    }
  return std::sqrt(sum / static_cast<double>(count));
}

// At the true poses and points a still camera would see every point where the correction puts it. What is left is the
// error of the velocities that the poses of neighbours tell.
TEST(RollingShutterCorrection, MakesMeasurementsThoseOfAStillCamera) {
  for (const auto scene : {SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet}) {
    SingleTile tile(flight(scene));
    const TileState truth = tile.truth();
    const double before = rms_residual(tile.problem, truth);
    const FramePaths paths(tile.simulated.block);
    correct_rolling_shutter(tile_readouts(tile.simulated.block, tile.problem),
                            tile_motions(paths, tile.problem, truth, tile.simulated.truth), truth, tile.problem);
    const double after = rms_residual(tile.problem, truth);
    EXPECT_GT(before, 1);
    EXPECT_LT(after, 0.02 * before);
  }
}

TEST(RollingShutterCorrection, LeavesOtherCamerasAlone) {
  SingleTile tile(flight(SimulationOptions::Scene::kAerial));
  const std::vector<double> x = tile.problem.x, y = tile.problem.y;
  tile.simulated.block.cameras[CameraIndex(0)].readout_s = 0;
  const TileState truth = tile.truth();
  correct_rolling_shutter(tile_readouts(tile.simulated.block, tile.problem),
                          tile_motions(FramePaths(tile.simulated.block), tile.problem, truth, tile.simulated.truth),
                          truth, tile.problem);
  EXPECT_EQ(tile.problem.x, x);
  EXPECT_EQ(tile.problem.y, y);
}

// From the usual start values, which lie a metre and a degree off.
TEST(RollingStart, LeadsToTheTruth) {
  SimulationOptions options = flight(SimulationOptions::Scene::kAerial);
  options.image_noise_px = 0.5;
  SingleTile still(options), moving(options);
  adjust_tile(still.problem, still.state, {});
  const FramePaths paths(moving.simulated.block);
  const BlockState start = initial_state(moving.simulated.block);
  adjust_moving_tile(
      {paths, tile_readouts(moving.simulated.block, moving.problem), start}, moving.problem, moving.state, {},
      static_cast<AdjustSummary (*)(const TileProblem&, TileState&, const SolveOptions&)>(solve_with_ceres));
  EXPECT_LT(moving.position_rms(), 0.04);  // positions are observed with 0.05 m
  EXPECT_GT(still.position_rms(), 1.4 * moving.position_rms());
  EXPECT_GT(still.rotation_rms(), 1.4 * moving.rotation_rms());
}

}  // namespace
}  // namespace megablock
