// Directions of the datum that priors determine, but hardly: they are held, stay held near the limit, and let the
// iterations end.
#include "merge/datum/gauge.h"

#include <gtest/gtest.h>

#include "io/block/held_priors.h"
#include "merge/tree/global_adjustment.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

// One part with this information about its rotations (1 / rad^2) and its scale. Its shifts are well known.
BlockGauge gauge_with(const Eigen::Vector3d& rotations, double scale, const HeldAgainstPriors& before = {}) {
  GaugePart part;
  part.frames = 3;
  part.lowest_frame = 0;
  part.extreme_frames = {0, 1, 0, 2, 0, 1};
  part.extreme_centres << 0, 50, 0, 0, 0, 50, 0, 0, 0, 50, 0, 0, 0, 0, 0, 0, 0, 0;
  part.extent = 50;
  Eigen::Matrix<double, 7, 1> information;
  information << rotations, Eigen::Vector3d::Constant(1e6), scale;
  part.normal = information.asDiagonal();
  return make_gauge({{{part}}}, before);
}

TEST(Gauge, HoldsWhatPriorsGiveNoBetterThanToARadian) {
  EXPECT_EQ(gauge_with({0.5, 1.5, 90}, 9).defect(), 1);
  EXPECT_EQ(gauge_with({0.5, 1.5, 90}, 9).against_priors().rotations, 1);
  EXPECT_FALSE(gauge_with({0.5, 1.5, 90}, 9).against_priors().scale);
  EXPECT_EQ(gauge_with({0.5, 1.5, 90}, 0.9).defect(), 2);
  EXPECT_TRUE(gauge_with({0.5, 1.5, 90}, 0.9).against_priors().scale);
  EXPECT_EQ(gauge_with({2, 3, 90}, 9).defect(), 0);
  // What nothing determines at all is free, but not against anything.
  EXPECT_EQ(gauge_with({0, 20, 90}, 9).defect(), 1);
  EXPECT_FALSE(gauge_with({0, 20, 90}, 9).against_priors().any());
}

TEST(Gauge, ReleasesWhatItHasHeldOnlyWellAboveTheLimit) {
  EXPECT_EQ(gauge_with({2, 3, 90}, 9, {1, false}).defect(), 1);
  EXPECT_EQ(gauge_with({2, 3, 90}, 9, {2, false}).defect(), 2);
  EXPECT_EQ(gauge_with({2, 3, 90}, 9, {2, true}).defect(), 3);
  EXPECT_EQ(gauge_with({17, 20, 90}, 17, {2, true}).defect(), 0);
  // A rotation that nothing determines is none of those held against priors.
  EXPECT_EQ(gauge_with({0, 3, 90}, 20, {1, false}).defect(), 2);
}

// Positions without heights give the tilt by the small differences of the heights alone. Where they are worse than
// stated they pull hard at the rotations that are held, and the iterations end in spite of it.
TEST(Gauge, IterationsEndWherePriorsPullAtHeldRotations) {
  SimulationOptions options;
  options.frames = 40;
  options.points_per_frame = 60;
  options.gps_sigma_m = 40;
  options.attitude_sigma_deg = 0;
  SimulatedBlock s = simulate_block(options);
  for (FrameIndex f(0); f.value < 40; ++f.value) {
    s.block.frames[f].attitude_prior.reset();
    s.block.frames[f].position_prior->sigma = {10, 10, kUnknownHeightSigma};
  }
  ObservationOptions observations;
  observations.position_loss.kind = RobustLoss::Kind::kNone;
  const TiledBlock block(std::move(s), 14, observations, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global({});
  adjust_globally(runner, {}, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  EXPECT_LE(state.iterations, 15);
  EXPECT_GE(runner.block_gauge().against_priors().rotations, 1);
  EXPECT_EQ(state.held % 4, runner.block_gauge().against_priors().rotations);
}

}  // namespace
}  // namespace megablock
