#include "merge/camera/readout_time.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

ReadoutEstimate estimate(const SimulatedBlock& simulated) {
  return estimate_readout(simulated.block, initial_state(simulated.block), simulated.tracks,
                          IndexedVector<CameraIndex, double>(simulated.block.cameras.size(), 0.0), CameraIndex(0), {});
}

SimulationOptions flight(double readout_ms, std::uint64_t seed) {
  SimulationOptions options;
  options.frames = 40;
  options.seed = seed;
  options.readout_ms = readout_ms;
  options.start_readout = 0;
  return options;
}

TEST(ReadoutTime, IsFoundWithItsSigma) {
  double squares = 0;
  int count = 0;
  for (const double readout_ms : {30.0, -20.0, 5.0})
    for (const std::uint64_t seed : {1, 2}) {
      const ReadoutEstimate found = estimate(simulate_block(flight(readout_ms, seed)));
      ASSERT_GT(found.sigma_s, 0);
      EXPECT_LT(found.sigma_s, 3.5e-3);  // positions of 5 cm over 200 m tell no more
      squares += std::pow((found.time_s - readout_ms / 1000) / found.sigma_s, 2);
      ++count;
    }
  EXPECT_LT(std::sqrt(squares / count), 1.7);  // six good ones exceed it once in a hundred times
}

TEST(ReadoutTime, IsUnknownWithoutTimes) {
  SimulatedBlock simulated = simulate_block(flight(30, 1));
  for (Frame& frame : simulated.block.frames) frame.time_s = std::nan("");
  EXPECT_FALSE(estimate(simulated).failure.empty());
}

TEST(ReadoutTime, CountsWhereItIsSignificantAndConfirmsTheTable) {
  EXPECT_EQ(choose_readout({0.031, 0.001, ""}, 0).time_s, 0.031);
  EXPECT_EQ(choose_readout({0.031, 0.001, ""}, 0.033).time_s, 0.031);
  EXPECT_EQ(choose_readout({0.002, 0.001, ""}, 0).time_s, 0);
  EXPECT_EQ(choose_readout({-0.015, 0.001, ""}, 0.033).time_s, 0);
  EXPECT_EQ(choose_readout({0.031, 0.001, "no path"}, 0.033).time_s, 0);
  EXPECT_THAT(
      choose_readout({-0.015, 0.001, ""}, 0.033).reason,
      testing::HasSubstr("the images give a readout time of -15.0 ± 1.0 ms, where a table of cameras says 33 ms"));
}

}  // namespace
}  // namespace megablock
