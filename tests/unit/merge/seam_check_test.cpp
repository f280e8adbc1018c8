#include "merge/seam_check.h"

#include <gtest/gtest.h>

#include "tests/unit/merge/tiled_block.h"

namespace megablock {
namespace {

SimulationOptions scene() {
  SimulationOptions o;
  o.frames = 60;
  o.points_per_frame = 60;
  o.gps_sigma_m = 0.2;
  o.calibrate = false;
  return o;
}

ObservationOptions without_loss() {
  ObservationOptions options;
  options.image_loss.kind = options.position_loss.kind = RobustLoss::Kind::kNone;
  return options;
}

void adjust(SerialRunner& runner) {
  GlobalOptions options;
  options.max_decrement = 1e-4;
  GlobalState state = start_global(options);
  adjust_globally(runner, options, state);
  ASSERT_EQ(state.outcome, GlobalOutcome::kConverged);
  runner.final_up();
}

// Over all seams and several blocks the sum of T is chi-square distributed with the sum of the degrees.
TEST(SeamCheck, HasItsChiSquareMeanOnCleanData) {
  double statistic = 0, degrees = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions options = scene();
    options.seed = seed;
    const TiledBlock block(simulate_block(options), 12, without_loss(), 0.02);
    SerialRunner runner(block.tiles.tree, block.problems, block.states);
    adjust(runner);
    ASSERT_GE(runner.seams().size(), 4u);
    for (const SeamReport& seam : runner.seams()) {
      EXPECT_FALSE(seam.alarm()) << "T " << seam.statistic << " of " << seam.degrees;
      statistic += seam.statistic;
      degrees += static_cast<double>(seam.degrees);
    }
    EXPECT_TRUE(describe_seams(runner.seams(), runner.tile_checks()).empty());
  }
  EXPECT_GT(degrees, 500);
  EXPECT_NEAR(statistic, degrees, 5 * std::sqrt(2 * degrees));
}

TEST(SeamCheck, NamesTheTileThatWasShifted) {
  TiledBlock block(simulate_block(scene()), 12, without_loss(), 0.02);
  constexpr std::size_t kWrong = 2;
  // All positions that this tile observes are 1.5 m off.
  for (auto& term : block.problems[kWrong].positions) term.prior.position.x() += 1.5;
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  adjust(runner);
  int alarms = 0;
  for (const SeamReport& seam : runner.seams()) alarms += seam.alarm();
  EXPECT_GE(alarms, 1);
  const std::vector<std::string> lines = describe_seams(runner.seams(), runner.tile_checks());
  ASSERT_FALSE(lines.empty());
  EXPECT_NE(lines.front().find("tile 2 "), std::string::npos) << lines.front();
}

}  // namespace
}  // namespace megablock
