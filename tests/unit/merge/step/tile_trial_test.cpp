// The trial of a step in one call, against the sequence of its parts.
#include "merge/step/tile_trial.h"

#include <gtest/gtest.h>

#include "adjust/terms/linearise.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

// Of every tile: the step and what is made of it; a start a little off, so that the losses have a tail.
void expect_parts(const SimulationOptions& options, const RobustLoss& loss) {
  TiledBlock block(simulate_block(options), 12, {}, 0.05);
  for (TileProblem& problem : block.problems) problem.image_loss = loss;
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const Sweep sweep(1e-3, true);
  runner.up(sweep);
  runner.down(sweep);
  std::vector<MotionSums> sums;
  for (std::size_t t = 0; t < runner.problems().size(); ++t)
    sums.push_back(motion_sums(runner.block_gauge(), static_cast<std::int64_t>(t), runner.problems()[t],
                               runner.tile_plans()[t], runner.states()[t], runner.steps()[t].unknowns));
  const std::vector<BlockMotion> motions = block_motions(runner.block_gauge(), sums);
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    const TileProblem& problem = runner.problems()[t];
    const TilePlan& plan = runner.tile_plans()[t];
    const TileStep& step = runner.steps()[t];
    TileState expected = apply_step(runner.block_gauge(), motions, static_cast<std::int64_t>(t), problem, plan,
                                    runner.states()[t], step);
    const double cost = refine_points(problem, plan, expected);
    TileStep alone;  // without the points
    alone.unknowns = step.unknowns;
    const TileTrial trial = try_step(runner.block_gauge(), motions, static_cast<std::int64_t>(t), problem, plan,
                                     runner.states()[t], sweep, alone);
    EXPECT_EQ(trial.cost, cost);
    EXPECT_EQ(trial.state.points, expected.points);
    EXPECT_GT(trial.damping_norm, 0);
    for (std::size_t f = 0; f < expected.frames.size(); ++f) {
      EXPECT_EQ(trial.state.frames[f].centre, expected.frames[f].centre);
      EXPECT_EQ(trial.state.frames[f].rotation.coeffs(), expected.frames[f].rotation.coeffs());
    }
  }
}

SimulationOptions aerial() {
  SimulationOptions options;
  options.frames = 60;
  options.points_per_frame = 60;
  return options;
}

TEST(TileTrial, HasTheBitsOfItsParts) {
  using enum RobustLoss::Kind;
  for (const auto kind : {kNone, kHuber, kCauchy, kCauchyTail}) expect_parts(aerial(), {kind, 1.5});
}

TEST(TileTrial, KnowsCamerasThatLanesDoNot) {
  SimulationOptions options = aerial();
  options.camera_model = "even-radial-3";
  expect_parts(options, {RobustLoss::Kind::kHuber, 1.5});
}

}  // namespace
}  // namespace megablock
