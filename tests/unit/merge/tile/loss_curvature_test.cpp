// Robust losses: their curvature against finite differences, points in the tail, and the number of iterations.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "merge/checks/monolithic.h"
#include "merge/tile/point_refinement.h"
#include "merge/tile/tile_linearisation.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

const RobustLoss kHuber{RobustLoss::Kind::kHuber, 1.5}, kCauchy{RobustLoss::Kind::kCauchy, 1.5},
    kCauchyTail{RobustLoss::Kind::kCauchyTail, 1.5};

// Gradient of 1/2 rho(|r|^2), by central differences.
Eigen::VectorXd gradient(const RobustLoss& loss, const Eigen::VectorXd& r) {
  const double h = 1e-5;
  Eigen::VectorXd g(r.size());
  for (Eigen::Index k = 0; k < r.size(); ++k) {
    const Eigen::VectorXd d = h * Eigen::VectorXd::Unit(r.size(), k);
    g[k] = (loss.evaluate((r + d).squaredNorm())[0] - loss.evaluate((r - d).squaredNorm())[0]) / (4 * h);
  }
  return g;
}

Eigen::MatrixXd hessian(const RobustLoss& loss, const Eigen::VectorXd& r) {
  const double h = 1e-3;
  Eigen::MatrixXd m(r.size(), r.size());
  for (Eigen::Index k = 0; k < r.size(); ++k) {
    const Eigen::VectorXd d = h * Eigen::VectorXd::Unit(r.size(), k);
    m.col(k) = (gradient(loss, r + d) - gradient(loss, r - d)) / (2 * h);
  }
  return m;
}

void expect_weighting(const RobustLoss& loss, const Eigen::Vector3d& r) {
  Eigen::Matrix<double, 3, 4> jacobian;
  jacobian << 1, 2, 0.5, -1, 0.3, -0.7, 2, 0.1, -1.2, 0.4, 0.9, 1.5;
  Eigen::Matrix3d expected = hessian(loss, r);
  // Along the residual no less than kLeastCurvature rho'.
  const double least = kLeastCurvature * loss.evaluate(r.squaredNorm())[1];
  const Eigen::Vector3d along = r.normalized();
  const double value = along.dot(expected * along);
  if (value < least) expected += (least - value) * along * along.transpose();
  for (const bool curvature : {false, true}) {
    const LossWeight weight(loss, r.squaredNorm(), curvature);
    const Eigen::Matrix<double, 3, 4> weighted = weight.weighted(jacobian, r);
    EXPECT_LE((weighted.transpose() * (weight.residual_scale * r) - jacobian.transpose() * gradient(loss, r)).norm(),
              1e-8 * jacobian.norm() * r.norm());
    const Eigen::Matrix3d inner = curvature ? expected : Eigen::Matrix3d(weight.first * Eigen::Matrix3d::Identity());
    EXPECT_LE((weighted.transpose() * weighted - jacobian.transpose() * inner * jacobian).norm(), 1e-4);
  }
}

TEST(LossCurvature, EqualsFiniteDifferences) {
  for (const double length : {0.3, 1.2, 1.8, 4.0, 30.0}) {
    expect_weighting(kHuber, length * Eigen::Vector3d(0.6, -0.48, 0.64));
    expect_weighting(kCauchy, length * Eigen::Vector3d(0.6, -0.48, 0.64));
    expect_weighting(kCauchyTail, length * Eigen::Vector3d(0.6, -0.48, 0.64));
  }
}

// Noise of nearly twice the stated sigma: a quarter of the observations lie beyond the corner of the loss.
SimulationOptions heavy_tailed() {
  SimulationOptions options;
  options.frames = 60;
  options.points_per_frame = 80;
  options.image_noise_px = 0.9;
  options.gps_sigma_m = 1;
  return options;
}

double cost_of(const TileProblem& problem, const TileState& state, std::int64_t point) {
  TileProblem one = problem;
  for (std::int64_t row = 0; row < one.observation_count(); ++row)
    one.kept[row] = one.kept[row] && row >= problem.begin[point] && row < problem.begin[point + 1];
  one.positions.clear();
  return evaluate_cost(one, state);
}

TEST(PointRefinement, EndsWhereEveryPointIsAtItsOptimum) {
  const TiledBlock block(simulate_block(heavy_tailed()), 12, {}, 0.05);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const TileProblem& problem = runner.problems().front();
  const TilePlan& plan = runner.tile_plans().front();
  const TileState before = runner.states().front();
  TileState after = before;
  refine_points(problem, plan, after);
  EXPECT_LT(evaluate_cost(problem, after), evaluate_cost(problem, before));
  int moved = 0;
  for (const RowList& cell : plan.points)
    for (const std::int64_t p : cell.rows()) {
      const auto row = static_cast<std::size_t>(p);
      if (after.points[row] == before.points[row]) continue;
      if (++moved > 20) continue;
      const double cost = cost_of(problem, after, p);
      for (int k = 0; k < 6; ++k) {  // no direction goes further down
        TileState shifted = after;
        shifted.points[row] += (k < 3 ? 1e-3 : -1e-3) * Eigen::Vector3d::Unit(k % 3);
        EXPECT_GE(cost_of(problem, shifted, p), cost * (1 - 1e-9)) << "point " << p;
      }
    }
  EXPECT_GT(moved, 20);
  TileState again = after;
  refine_points(problem, plan, again);
  for (std::size_t p = 0; p < again.points.size(); ++p)
    EXPECT_LE((again.points[p] - after.points[p]).norm(), 1e-5) << "point " << p;
}

// A step through the cameras is no reason to give up the points that it has turned behind them.
TEST(PointRefinement, BringsPointsBackFromBehindTheirCameras) {
  const TiledBlock block(simulate_block(heavy_tailed()), 12, {}, 0.05);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const TileProblem& problem = runner.problems().front();
  const TilePlan& plan = runner.tile_plans().front();
  TileState expected = runner.states().front(), state = expected;
  refine_points(problem, plan, expected);
  int refined = 0;
  for (const RowList& cell : plan.points)
    for (const std::int64_t p : cell.rows()) {
      const auto row = static_cast<std::size_t>(p);
      if (expected.points[row] == state.points[row]) continue;
      const Eigen::Vector3d& camera = state.frames[static_cast<std::size_t>(frame_of_point(problem, p))].centre;
      state.points[row] = 2 * camera - state.points[row];
      ++refined;
    }
  ASSERT_GT(refined, 20);
  EXPECT_FALSE(std::isfinite(evaluate_cost(problem, state)));
  refine_points(problem, plan, state);
  EXPECT_NEAR(evaluate_cost(problem, state), evaluate_cost(problem, expected), 1e-9 * evaluate_cost(problem, expected));
}

TEST(PointRefinement, LeavesPointsWithoutTailAlone) {
  SimulationOptions options = heavy_tailed();
  options.image_noise_px = 0.05;
  const TiledBlock block(simulate_block(options), 12, {}, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  TileState state = runner.states().front();
  refine_points(runner.problems().front(), runner.tile_plans().front(), state);
  EXPECT_EQ(state.points, runner.states().front().points);
}

// Attitudes decide on rotations as much as tie points do, and one of five lies beyond their loss's corner.
TEST(GlobalAdjustment, TakesFewStepsWithAttitudes) {
  SimulationOptions options;
  options.frames = 60;
  options.points_per_frame = 60;
  options.gps_sigma_m = 0.05;
  options.attitude_sigma_deg = 0.02;
  ObservationOptions observations;
  observations.attitude_loss.scale = 2;
  for (const std::uint64_t seed : {1, 2}) {
    options.seed = seed;
    const TiledBlock block(simulate_block(options), 25, observations, 0.01);
    const auto beyond = std::ranges::count_if(block.whole.attitudes, [&](const auto& term) {
      const FrameIndex frame = block.whole.frames[static_cast<std::size_t>(term.frame.value)];
      const double s = linearise_attitude(block.simulated.truth.frames[frame], term.prior).residual.squaredNorm();
      return !block.whole.attitude_loss.squares(s);
    });
    ASSERT_GE(beyond, 10);
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    GlobalOptions global;
    global.max_decrement = 1e-6;
    GlobalState state = start_global(global);
    adjust_globally(runner, global, state);
    EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
    EXPECT_LE(state.iterations, 8) << describe(state);  // 11 to more than 30 with the logarithm from the corner on
  }
}

TEST(GlobalAdjustment, TakesFewStepsWithHeavyTails) {
  const TiledBlock block(simulate_block(heavy_tailed()), 12, {}, 0.05);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalOptions options;
  options.max_decrement = 1e-4;
  GlobalState state = start_global(options);
  adjust_globally(runner, options, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  EXPECT_LE(state.iterations, 15) << describe(state);
  EXPECT_LE(max_pose_difference_sigmas(block.whole, block.gathered(runner.problems(), runner.states())), 1e-4);
}

}  // namespace
}  // namespace megablock
