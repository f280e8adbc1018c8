#include "adjust/tile/prior_scales.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

using enum ObservationKind;

SimulationOptions with_control() {
  SimulationOptions options;
  options.frames = 60;
  options.points_per_frame = 30;
  options.control_points = 9;
  return options;
}

// The lengths at the true state: no unknown has taken up any of the errors, and the redundancy is one.
PriorLengths lengths_at_truth(SimulatedBlock simulated) {
  SingleTile tile(std::move(simulated));
  tile.state = tile.truth();
  return prior_lengths(tile.problem, tile.state);
}

TEST(LengthCounts, MedianIsThatOfTheLengths) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss;
  LengthCounts counts;
  for (int i = 0; i < 20'000; ++i) counts.add(7 * std::hypot(gauss(random), gauss(random)));
  EXPECT_NEAR(counts.median() / (7 * 1.1774), 1, 0.06);  // half a bin, and the noise of the sample
  for (int i = 0; i < 4'000; ++i) counts.add(1e9);       // gross errors move the median to the quantile 0.6
  EXPECT_EQ(counts.total(), 24'000);
  EXPECT_NEAR(counts.median() / (7 * std::sqrt(-2 * std::log(0.4))), 1, 0.06);
  EXPECT_EQ(LengthCounts().median(), 0);
}

TEST(LengthCounts, KnowWhetherAnyIsLarger) {
  LengthCounts counts;
  EXPECT_FALSE(counts.any_above(0));
  for (const double length : {0.0, 1e-9, 0.5, 2.6}) counts.add(length);
  EXPECT_TRUE(counts.any_above(2));
  EXPECT_FALSE(counts.any_above(3));
  EXPECT_FALSE(counts.any_above(1e12));
  counts.add(1e12);
  EXPECT_TRUE(counts.any_above(1e3));
}

// Positions that are ten times worse than stated, and one control point that is far off.
TEST(PriorScales, FollowFromTheResidualsOfMost) {
  SimulatedBlock simulated = simulate_block(with_control());
  for (Frame& frame : simulated.block.frames) frame.position_prior->sigma /= 10;
  simulated.block.control_points[2].position += Eigen::Vector3d(50, 0, 20);
  const SigmaScales scales = contradicted_sigma_scales({}, lengths_at_truth(std::move(simulated)));
  EXPECT_NEAR(scales[kPositionHorizontal], 10, 2.5);  // 60 medians: 10 % noise each
  EXPECT_NEAR(scales[kPositionHeight], 10, 3);
  EXPECT_EQ(scales[kControlHorizontal], 1);  // nine points of the stated sigma
  EXPECT_EQ(scales[kControlHeight], 1);
  EXPECT_EQ(scales[kTieImage], 1);
}

TEST(PriorScales, LeaveSigmasThatAreTwiceTooSmall) {
  SimulatedBlock simulated = simulate_block(with_control());
  for (Frame& frame : simulated.block.frames) frame.position_prior->sigma /= 2;
  EXPECT_FALSE(contradicted_sigma_scales({}, lengths_at_truth(std::move(simulated))).matter());
}

// A factor that was too large is taken back, to the stated sigmas where these hold.
TEST(PriorScales, AreTakenBack) {
  const SimulatedBlock simulated = simulate_block(with_control());
  SigmaScales now;
  now[kControlHeight] = 8;
  SimulatedBlock scaled = simulated;
  for (ControlPoint& point : scaled.block.control_points) point.sigma.z() *= 8;
  const SigmaScales change = contradicted_sigma_scales(now, lengths_at_truth(std::move(scaled)));
  EXPECT_DOUBLE_EQ(now[kControlHeight] * change[kControlHeight], 1);
}

TEST(PriorScales, LeaveHeldPositionsAndFewPointsAlone) {
  SimulatedBlock simulated = simulate_block(with_control());
  for (Frame& frame : simulated.block.frames) frame.position_prior->sigma.setConstant(1e-8);
  simulated.block.control_points.resize(3);
  simulated.control_truth.resize(3);
  for (ControlPoint& point : simulated.block.control_points) point.sigma /= 100;
  const PriorLengths lengths = lengths_at_truth(std::move(simulated));
  EXPECT_EQ(lengths.position_horizontal.total(), 0);
  EXPECT_EQ(lengths.control_height.total(), 3);
  EXPECT_FALSE(contradicted_sigma_scales({}, lengths).matter());
}

TEST(PriorScales, LossesPullFromAfarFirst) {
  SingleTile tile(with_control());
  const ObservationOptions options;
  set_losses_from_afar(tile.problem, options);
  EXPECT_EQ(tile.problem.position_loss.kind, RobustLoss::Kind::kHuber);
  EXPECT_EQ(tile.problem.control_loss.kind, RobustLoss::Kind::kHuber);
  set_last_losses(tile.problem, options);
  EXPECT_EQ(tile.problem.position_loss.kind, RobustLoss::Kind::kCauchyTail);
  EXPECT_EQ(tile.problem.control_loss.kind, RobustLoss::Kind::kCauchyTail);
}

}  // namespace
}  // namespace megablock
