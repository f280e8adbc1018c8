#include "adjust/tile/prior_scales.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "adjust/orientation/position_offset.h"
#include "adjust/tile/sigma_scales.h"
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

// Of two groups of positions one is stated five times too good, and one has too few positions to tell.
TEST(PriorScales, GroupsOfPositionsHaveTheirOwn) {
  SimulatedBlock simulated = simulate_block(with_control());
  std::vector<FrameIndex> worse, few;
  for (std::int64_t f = 10; f < 30; ++f) worse.emplace_back(f);
  for (std::int64_t f = 40; f < 43; ++f) few.emplace_back(f);
  add_position_group(worse, {0, 0, 20}, {0, 0, 1}, simulated.block, simulated.truth);
  add_position_group(few, {1, 2, 3}, {1, 1, 1}, simulated.block, simulated.truth);
  for (const FrameIndex f : worse) {
    simulated.block.frames[f].position_prior->position.z() += 20;
    simulated.block.frames[f].position_prior->sigma /= 5;
  }
  for (const FrameIndex f : few) {
    simulated.block.frames[f].position_prior->position += Eigen::Vector3d(1, 2, 3);
    simulated.block.frames[f].position_prior->sigma /= 5;
  }
  const RigIndex group = simulated.block.frames[worse.front()].position_prior->group;
  const RigIndex group_of_few = simulated.block.frames[few.front()].position_prior->group;
  const PriorLengths lengths = lengths_at_truth(simulated);
  SigmaScales scales = contradicted_sigma_scales({}, lengths);
  ASSERT_EQ(scales.group_count, 1);
  EXPECT_NEAR(scales.of_positions(group).horizontal, 5, 2);
  EXPECT_NEAR(scales.of_positions(group).height, 5, 2);
  EXPECT_EQ(scales.of_positions(group_of_few).height, 1);
  EXPECT_EQ(scales[kPositionHeight], 1);
  // The sigmas of the group alone are multiplied, and asked for no further factor.
  SingleTile tile(simulated);
  scale_sigmas(tile.problem, scales);
  tile.state = tile.truth();
  for (const auto& term : tile.problem.positions) {
    const PositionPrior& stated =
        *simulated.block.frames[tile.problem.frames[static_cast<std::size_t>(term.frame.value)]].position_prior;
    EXPECT_DOUBLE_EQ(term.prior.sigma.z(), stated.sigma.z() * (stated.group == group ? scales.groups[0].height : 1));
  }
  EXPECT_FALSE(contradicted_sigma_scales(scales, prior_lengths(tile.problem, tile.state)).differ_by(1.1));
}

// Another factor of the kind does not change those of a group; a group without its own has those of the kind.
TEST(SigmaScales, OfGroupsTakeThePlaceOfThoseOfTheKind) {
  SigmaScales scales, change;
  scales[kPositionHeight] = 4;
  EXPECT_EQ(scales.of_positions(RigIndex(7)).height, 4);
  change.set_positions({RigIndex(7), 1, 2});
  change.set_positions({RigIndex(3), 5, 1});
  change[kPositionHeight] = 3;
  scales.multiply(change);
  EXPECT_EQ(scales.groups[0].group, RigIndex(3));
  EXPECT_EQ(scales.of_positions(RigIndex(3)).horizontal, 5);
  EXPECT_EQ(scales.of_positions(RigIndex(3)).height, 4);
  EXPECT_EQ(scales.of_positions(RigIndex(7)).height, 8);
  EXPECT_EQ(scales.of_positions(RigIndex()).height, 12);
  EXPECT_TRUE(scales.differ_by(11));
  EXPECT_FALSE(scales.differ_by(13));
  for (std::int64_t group = 10; group < 100; ++group) scales.set_positions({RigIndex(group), 2, 2});
  EXPECT_EQ(scales.group_count, 32);
}

// Forty groups that are all stated ten times too good: those without a place count together.
TEST(PriorScales, OfMoreGroupsThanHaveAPlace) {
  PriorLengths lengths;
  for (std::int64_t g = 0; g < 40; ++g)
    for (int i = 0; i < 10; ++i)
      lengths.of(RigIndex(g)).horizontal.add(11.774), lengths.of(RigIndex(g)).height.add(6.745);
  const SigmaScales scales = contradicted_sigma_scales({}, lengths);
  EXPECT_EQ(scales.group_count, 32);
  for (std::int64_t g = 0; g < 40; ++g) {
    // Of 1200 numbers and ten in a group. A bin of the median is 9 % wide.
    const double factor = 10 / std::sqrt(1 - 7 / 1200.0 - (g < 32 ? 0.1 : 0));
    EXPECT_NEAR(scales.of_positions(RigIndex(g)).horizontal, factor, 0.05 * factor) << g;
    EXPECT_NEAR(scales.of_positions(RigIndex(g)).height, factor, 0.05 * factor) << g;
  }
}

// A group whose factor was too large gets a smaller one, and keeps it when it has too few positions left.
TEST(PriorScales, OfGroupsAreTakenBack) {
  SigmaScales now;
  now.set_positions({RigIndex(2), 8, 8});
  PriorLengths lengths;
  for (int i = 0; i < 10; ++i)
    lengths.of(RigIndex(2)).horizontal.add(1.1774 / 8), lengths.of(RigIndex(2)).height.add(0.6745);
  SigmaScales change = contradicted_sigma_scales(now, lengths);
  EXPECT_DOUBLE_EQ(change.of_positions(RigIndex(2)).horizontal, 1.0 / 8);
  const double factor = 1 / std::sqrt(1 - 7 / 30.0 - 0.1);  // of thirty numbers
  EXPECT_NEAR(change.of_positions(RigIndex(2)).height, factor, 0.05 * factor);
  lengths = {};
  for (int i = 0; i < 3; ++i) lengths.of(RigIndex(2)).horizontal.add(100);
  for (int i = 0; i < 10; ++i) lengths.position_horizontal.add(1);
  change = contradicted_sigma_scales(now, lengths);
  EXPECT_EQ(change.of_positions(RigIndex(2)).horizontal, 1);
  EXPECT_EQ(change[kPositionHorizontal], 1);
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
