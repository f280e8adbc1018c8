// The quadratic form of the camera parameters against adjustments with held cameras and against the whole normal
// equations.
#include "merge/camera/camera_equations.h"

#include <gtest/gtest.h>

#include <cmath>

#include "adjust/calibration/rig_observations.h"
#include "adjust/lanes/tile_cost.h"
#include "io/simulate/blocks/simulate.h"
#include "merge/checks/monolithic.h"
#include "merge/tree/tile_solver.h"

namespace megablock {
namespace {

// An aerial block with positions, at the optimum of all usual parameters but k3. The quadratic form has no loss.
WholeBlock adjusted(const SimulatedBlock& simulated) {
  WholeBlock whole = whole_block(simulated.block, simulated.truth, simulated.tracks, {});
  whole.problem.image_loss = whole.problem.position_loss = {};
  whole.state.points = simulated.points;
  solve_by_condensation(whole.problem, whole.state, {50, 1e-12, {}});
  return whole;
}

SimulatedBlock aerial() {
  SimulationOptions options;
  options.frames = 16;
  options.points_per_frame = 80;
  options.affinity = 0.002;
  return simulate_block(options);
}

TEST(CameraEquations, AreTheSchurComplementOfTheWholeSystem) {
  const WholeBlock whole = adjusted(aerial());
  const auto form = condense_on_cameras(whole.problem, whole.state);
  ASSERT_TRUE(form);
  ASSERT_EQ(form->minimum.size(), 9);  // without k3
  const MonolithicSystem system = monolithic_system(whole.problem, whole.state);
  const Eigen::MatrixXd covariance = monolithic_covariance(system);
  const Eigen::Index column = system.camera_column[0];
  const Eigen::MatrixXd of_camera = covariance.block(column, column, 9, 9);
  const Eigen::MatrixXd ours = restricted_covariance(*form, std::vector<std::uint8_t>(9, 1));
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 9; ++j)
      EXPECT_NEAR(ours(i, j), of_camera(i, j), 1e-6 * std::sqrt(of_camera(i, i) * of_camera(j, j))) << i << ' ' << j;
}

// Held at another value, everything else adjusted: the cost is that of the form, and the other parameters are its
// restricted minimum, up to the curvature of the projection.
TEST(CameraEquations, PredictAdjustmentsWithHeldParameters) {
  const SimulatedBlock simulated = aerial();
  const WholeBlock whole = adjusted(simulated);
  const auto form = condense_on_cameras(whole.problem, whole.state);
  ASSERT_TRUE(form);
  const double least = 2 * evaluate_cost(whole.problem, whole.state);
  EXPECT_NEAR(form->least, least, 1e-6 * least);
  // Rows: f cx cy k1 k2 p1 p2 b1 b2. The affinity is held at 5 px, some four sigmas, from its optimum.
  WholeBlock held = whole;
  held.problem.camera_free[0] &= ~mask_of(kAffinity);
  held.state.cameras[0][kAffinity] += 5;
  solve_by_condensation(held.problem, held.state, {50, 1e-12, {}});
  std::vector<std::uint8_t> free(9, 1);
  free[7] = 0;
  Eigen::VectorXd start = form->minimum;
  start(7) += 5;
  const Eigen::VectorXd expected = restricted_minimum(*form, free, start);
  const Eigen::VectorXd sigma = restricted_covariance(*form, free).diagonal().cwiseSqrt();
  const double cost = 2 * evaluate_cost(held.problem, held.state);
  EXPECT_GT(cost - least, 10);
  EXPECT_NEAR(form->at(expected) - form->least, cost - least, 0.02 * (cost - least));
  const int parameters[] = {kFocal,       kPrincipalX,  kPrincipalY, kRadial1, kRadial2,
                            kDecentring1, kDecentring2, kAffinity,   kSkew};
  for (int i = 0; i < 9; ++i)
    if (free[static_cast<std::size_t>(i)]) {
      EXPECT_NEAR(held.state.cameras[0][static_cast<std::size_t>(parameters[i])], expected(i), 0.1 * sigma(i)) << i;
    }
}

TEST(CameraEquations, LeaveOutImages) {
  const SimulatedBlock simulated = aerial();
  const WholeBlock whole = adjusted(simulated);
  WholeBlock without = whole;
  for (std::int64_t row = 0; row < without.problem.observation_count(); ++row)
    if (without.problem.images[static_cast<std::size_t>(without.problem.image[row].value)].frame.value == 5)
      without.problem.kept[static_cast<std::size_t>(row)] = 0;
  const auto form = condense_on_cameras(without.problem, without.state);
  ASSERT_TRUE(form);
  solve_by_condensation(without.problem, without.state, {50, 1e-12, {}});
  const auto there = condense_on_cameras(without.problem, without.state);
  ASSERT_TRUE(there);
  // One step from the solution of all images comes as near as it needs to.
  const Eigen::VectorXd sigma = restricted_covariance(*there, std::vector<std::uint8_t>(9, 1)).diagonal().cwiseSqrt();
  EXPECT_LT(((form->minimum - there->minimum).cwiseQuotient(sigma)).cwiseAbs().maxCoeff(), 0.05);
}

}  // namespace
}  // namespace megablock
