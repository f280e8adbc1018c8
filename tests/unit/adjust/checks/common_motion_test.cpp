#include "adjust/checks/common_motion.h"

#include <gtest/gtest.h>

#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

// A measurement as wrong as it may be tells nothing where the loss says so: it counts as if it were rejected.
TEST(CommonMotion, ObservationsHaveTheWeightsOfTheirLosses) {
  SimulationOptions simulation;
  simulation.frames = 12;
  AdjustOptions options;
  options.observations.image_loss = {RobustLoss::Kind::kCauchy, 3.0};
  SingleTile tile(simulation, options);
  const TileState truth = tile.truth();
  MotionReference reference;
  reference.length = 100;
  const auto known = [&] { return common_motion(tile.problem, truth, reference).known; };
  const CommonMotion::Matrix7 all = known();
  constexpr std::size_t kWrong = 7;
  tile.problem.x[kWrong] += 1e7;
  const CommonMotion::Matrix7 with_wrong = known();
  tile.problem.kept[kWrong] = 0;
  const CommonMotion::Matrix7 without = known();
  EXPECT_LT((with_wrong - without).norm(), 1e-8 * all.norm());
  EXPECT_GT((all - without).norm(), 1e-5 * all.norm());
  tile.problem.kept[kWrong] = 1;
  tile.problem.image_loss = RobustLoss();
  EXPECT_GT((known() - without).norm(), 1e-5 * all.norm());
}

}  // namespace
}  // namespace megablock
