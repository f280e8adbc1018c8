// Scale bars give a block without any other datum its scale, with the accuracy that they state.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "adjust/tile/datum.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

constexpr double kSigma = 0.05;  // m

// A block without positions, with bars across it, measured with noise of their sigma.
SimulatedBlock free_block(unsigned seed) {
  SimulationOptions options;
  options.frames = 20;
  options.points_per_frame = 80;
  options.seed = seed;
  options.calibrate = false;
  options.gps_sigma_m = 0;
  SimulatedBlock simulated = simulate_block(options);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss(0, kSigma);
  for (std::int64_t f = 0; f < 5; ++f) {
    const FrameIndex from(f), to(f + 10);
    const double truth = (simulated.truth.frames[to].centre - simulated.truth.frames[from].centre).norm();
    simulated.block.frame_measurements["distances"].push_back({from, to, truth + gauss(random), kSigma});
  }
  return simulated;
}

// (Adjusted over true length of the mean bar - 1) in sigmas of that mean; the images tell the shape much better.
double scale_error_in_sigmas(const SingleTile& tile) {
  double adjusted = 0, truth = 0, bars = 0;
  for (const FrameMeasurement& bar : tile.simulated.block.frame_measurements.at("distances")) {
    const auto row = [&](FrameIndex frame) {
      return static_cast<std::size_t>(std::ranges::find(tile.problem.frames, frame) - tile.problem.frames.begin());
    };
    adjusted += (tile.state.frames[row(bar.to)].centre - tile.state.frames[row(bar.from)].centre).norm();
    truth += (tile.simulated.truth.frames[bar.to].centre - tile.simulated.truth.frames[bar.from].centre).norm();
    ++bars;
  }
  return (adjusted - truth) / (kSigma * std::sqrt(bars));
}

TEST(Distances, GiveAFreeBlockItsScale) {
  constexpr unsigned kBlocks = 10;
  double squares = 0;
  for (unsigned seed = 1; seed <= kBlocks; ++seed) {
    SingleTile tile(free_block(seed));
    ASSERT_EQ(tile.problem.measured.at("distances").size(), 5u);
    for (Pose& frame : tile.state.frames) frame.centre *= 1.3;  // a start of another scale
    EXPECT_TRUE(adjust_tile(tile.problem, tile.state, tile.options).usable);
    const double error = scale_error_in_sigmas(tile);
    EXPECT_LT(std::abs(error), 4);
    squares += error * error;
  }
  // Chi-square of ten blocks: outside these limits once in a thousand.
  EXPECT_GT(squares, 1.5);
  EXPECT_LT(squares, 30);
}

TEST(Distances, LeaveAFreeBlockTheOtherSixDegreesOfItsDatum) {
  SimulatedBlock with = free_block(1), without = with;
  without.block.frame_measurements.clear();
  const SingleTile bars(std::move(with)), none(std::move(without));
  const auto dimension = [](const SingleTile& tile) {
    const auto defects = datum_defects(tile.problem, tile.truth());
    EXPECT_EQ(defects.size(), 1u);
    return defects.empty() ? 0 : static_cast<int>(defects.front().dimension);
  };
  EXPECT_EQ(dimension(none), 7);
  EXPECT_EQ(dimension(bars), 6);
}

}  // namespace
}  // namespace megablock
