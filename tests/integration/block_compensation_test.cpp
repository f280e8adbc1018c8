// Tests blocks of 500 images in eight and more tiles: the block-wise adjustment must have the same optimum as one
// monolithic problem.
#include <gtest/gtest.h>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "merge/checks/monolithic.h"
#include "tests/support/merge/ceres_cost.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

void expect_same_optimum(const SimulationOptions& options, std::int64_t tile_max_frames) {
  const SimulatedBlock simulated = simulate_block(options);
  ASSERT_EQ(simulated.block.images.size(), 500u);
  const TiledBlock block(simulated, tile_max_frames, {}, 0.3);
  ASSERT_GE(block.tiles.tile_count, 8);
  ASSERT_GE(block.levels(), 3);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalOptions exact;
  exact.max_decrement = 1e-7;
  GlobalState state = start_global(exact);
  adjust_globally(runner, exact, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);

  const TileState solution = block.gathered(runner.problems(), runner.states());
  EXPECT_LE(max_pose_difference_sigmas(block.whole, solution), 1e-6);
  const double cost = evaluate_cost(block.whole, solution);
  EXPECT_NEAR(cost_after_ceres(block.whole, solution, 10), cost, 1e-9 * cost);

  runner.final_up();
  for (const SeamReport& seam : runner.seams()) EXPECT_FALSE(seam.alarm()) << "node " << seam.node;
}

TEST(BlockCompensation, AerialEqualsOneMonolithicProblem) {
  SimulationOptions options;
  options.frames = 500;
  options.points_per_frame = 100;
  options.control_points = 6;
  options.gps_sigma_m = 0.1;
  expect_same_optimum(options, 64);
}

TEST(BlockCompensation, StreetEqualsOneMonolithicProblem) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 250;
  options.rig_cameras = 2;
  options.points_per_frame = 150;
  options.relative_position_sigma_m = 0.02;
  expect_same_optimum(options, 32);
}

}  // namespace
}  // namespace megablock
