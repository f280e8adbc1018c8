// Covariances equal the inverse of the full normal equations; free blocks equal its pseudo-inverse after the same
// S-transformation.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "geometry/decompositions.h"
#include "merge/monolithic.h"
#include "tests/unit/adjust/known_lines.h"
#include "tests/unit/adjust/seen_verticals.h"
#include "tests/unit/merge/tiled_block.h"

namespace megablock {
namespace {

SimulationOptions small(SimulationOptions::Scene kind, std::int64_t frames, int points) {
  SimulationOptions o;
  o.scene = kind;
  o.frames = frames;
  o.points_per_frame = points;
  o.rig_cameras = 2;
  return o;
}

// Normal equations of everything, dense. Scaled to a unit diagonal for the inversions.
struct DenseNormal {
  Eigen::MatrixXd scaled;
  Eigen::VectorXd scale;
  explicit DenseNormal(const MonolithicSystem& system) {
    const Eigen::MatrixXd normal = Eigen::MatrixXd(system.jacobian.transpose() * system.jacobian);
    scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    scaled = scale.asDiagonal() * normal * scale.asDiagonal();
  }
};

// Compares every tile's covariances with diagonal blocks of `expected`, relative to the block's sigmas.
void expect_covariances(const TiledBlock& block, const std::vector<TileCovariance>& tiles,
                        const MonolithicSystem& system, const Eigen::MatrixXd& expected, double tolerance) {
  const auto compare = [&](const Eigen::MatrixXd& ours, std::int64_t column, const char* what) {
    const auto n = ours.rows();
    const Eigen::MatrixXd block_expected = expected.block(column, column, n, n);
    const Eigen::VectorXd sigma = block_expected.diagonal().cwiseSqrt();
    const Eigen::MatrixXd error =
        sigma.cwiseInverse().asDiagonal() * (ours - block_expected) * sigma.cwiseInverse().asDiagonal();
    EXPECT_LE(error.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), tolerance) << what << " at column " << column;
  };
  for (std::size_t t = 0; t < tiles.size(); ++t) {
    const TileProblem& problem = block.problems[t];
    for (std::size_t f = 0; f < problem.frames.size(); ++f)
      compare(tiles[t].frames[f], system.frame_column[TiledBlock::row(block.whole.frames, problem.frames[f])], "frame");
    for (std::size_t p = 0; p < problem.points.size(); ++p) {
      const std::int64_t column = system.point_column[block.point_row(problem.points[p])];
      if (column >= 0) compare(tiles[t].points[p], column, "point");
    }
    for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
      std::vector<int> free;
      for (int k = 0; k < tiles[t].cameras[c].rows(); ++k)
        if (contains(problem.camera_free[c], k)) free.push_back(k);
      if (free.empty()) continue;
      compare(Eigen::MatrixXd(tiles[t].cameras[c](free, free)),
              system.camera_column[TiledBlock::row(block.whole.cameras, problem.cameras[c])], "camera");
    }
  }
}

class Covariances : public testing::TestWithParam<SimulationOptions::Scene> {};

TEST_P(Covariances, EqualTheInverse) {
  const TiledBlock block(simulate_block(small(GetParam(), 30, 24)), 8, {}, 0.02);
  ASSERT_GE(block.tiles.tile_count, 4);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  const UpReport up = runner.final_up();
  EXPECT_TRUE(up.sums.held.empty());
  EXPECT_EQ(runner.gauge().text, "fixed by priors");
  const MonolithicSystem system = monolithic_system(block.whole, block.whole_state);
  const DenseNormal normal(system);
  const Eigen::MatrixXd inverse =
      solve_symmetric(normal.scaled, Eigen::MatrixXd::Identity(normal.scaled.rows(), normal.scaled.cols()));
  expect_covariances(block, runner.covariances(), system,
                     normal.scale.asDiagonal() * inverse * normal.scale.asDiagonal(), 1e-8);
}

// Dimension of the null space, and C = S H^+ S' with S from the same inner constraints, by eigenvalues of the dense H.
TEST_P(Covariances, OfAFreeBlockEqualThePseudoInverse) {
  SimulationOptions options = small(GetParam(), 20, 20);
  options.gps_sigma_m = 0;
  options.calibrate = false;
  const TiledBlock block(simulate_block(options), 6, {}, 0);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  const UpReport up = runner.final_up();
  const bool rig = GetParam() == SimulationOptions::Scene::kStreet;
  const Eigen::Index defect = rig ? 6 : 7;
  ASSERT_EQ(runner.gauge().defect, defect);
  EXPECT_NE(runner.gauge().text.find("free"), std::string::npos);
  EXPECT_TRUE(up.sums.held.empty());
  const std::vector<TileCovariance> covariances = runner.covariances();

  const MonolithicSystem system = monolithic_system(block.whole, block.whole_state);
  const DenseNormal normal(system);
  const SymmetricEigen eigen = symmetric_eigen(normal.scaled);
  const Eigen::Index n = normal.scaled.rows();
  EXPECT_LT(eigen.values(defect - 1), 1e-11);
  EXPECT_GT(eigen.values(defect), 1e-9);
  Eigen::VectorXd inverse_values = eigen.values.cwiseInverse();
  inverse_values.head(defect).setZero();
  const Eigen::MatrixXd any = normal.scale.asDiagonal() * eigen.vectors * inverse_values.asDiagonal() *
                              eigen.vectors.transpose() * normal.scale.asDiagonal();
  // Null space from the eigenvectors (not from the similarity's formulas); W over the frames, in the unit of the
  // extent.
  const Eigen::MatrixXd null = normal.scale.asDiagonal() * eigen.vectors.leftCols(defect);
  Eigen::VectorXd w = Eigen::VectorXd::Zero(n);
  for (std::int64_t column : system.frame_column)
    if (column >= 0) w.segment<6>(column) = runner.block_gauge().components.front().weights();
  const Eigen::MatrixXd weighted = w.asDiagonal() * null;
  const Eigen::MatrixXd s =
      Eigen::MatrixXd::Identity(n, n) - null * solve_symmetric(null.transpose() * weighted, weighted.transpose());
  expect_covariances(block, covariances, system, s * any * s.transpose(), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Covariances,
                         testing::Values(SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet),
                         [](const auto& p) {
                           return p.param == SimulationOptions::Scene::kAerial ? "Aerial" : "Street";
                         });

TEST(Gauge, PositionsOnOneLineLeaveOneRotation) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
  SimulatedBlock simulated = simulate_block(options);
  // Positions observed on two frames only: the rotation about the line through them stays free.
  int kept = 0;
  for (Frame& frame : simulated.block.frames)
    if (kept++ >= 2) frame.position_prior.reset();
  const TiledBlock block(std::move(simulated), 12, {}, 0);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  const UpReport up = runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 1);
  EXPECT_TRUE(up.sums.held.empty());
}

// Positions within their own noise of a straight line do not say how the block is turned about it.
TEST(Gauge, PositionsNearOneLineLeaveOneRotation) {
  for (const double sigma : {10.0, 0.05}) {
    SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
    options.gps_sigma_m = sigma;
    SimulatedBlock simulated = simulate_block(options);
    Eigen::Vector3d first = Eigen::Vector3d::Zero(), along = Eigen::Vector3d::Zero();
    int kept = 0;
    for (std::size_t f = 0; f < simulated.block.frames.size(); ++f) {
      const FrameIndex frame(static_cast<std::int64_t>(f));
      const Eigen::Vector3d centre = simulated.truth.frames[frame].centre;
      if (kept == 0) first = centre;
      if (kept == 1) along = (centre - first).normalized();
      const double off = kept < 2 ? 0 : along.cross(centre - first).norm();
      if (kept++ >= 2 && off > 3) simulated.block.frames[frame].position_prior.reset();
    }
    const TiledBlock block(std::move(simulated), 12, {}, 0);
    SerialRunner runner(block.tiles.tree, block.problems, block.states);
    runner.final_up();
    EXPECT_EQ(runner.gauge().defect, sigma > 1 ? 1 : 0) << "sigma " << sigma;
  }
}

TEST(Gauge, AttitudesLeaveShiftAndScale) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
  options.gps_sigma_m = 0;
  options.attitude_sigma_deg = 0.1;
  const TiledBlock block(simulate_block(options), 12, {}, 0);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 4);
}

TEST(Gauge, LinesLeaveShiftScaleAndHeading) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
  options.gps_sigma_m = 0;
  options.calibrate = false;
  SimulatedBlock simulated = simulate_block(options);
  add_known_lines(simulated, 10, 1);
  const TiledBlock block(std::move(simulated), 12, {}, 0);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 5);
}

TEST(Gauge, VerticalsLeaveShiftScaleAndHeading) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
  options.gps_sigma_m = 0;
  SimulatedBlock simulated = simulate_block(options);
  add_seen_verticals(simulated, {.by_radial = 0.02, .every = 3});
  const TiledBlock block(std::move(simulated), 12, {}, 0);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 5);
}

// The datum is a matter of convention: cost, decrement and the adjusted observations do not depend on it.
TEST(Gauge, FreeBlockReachesTheOptimum) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 60, 60);
  options.gps_sigma_m = 0;
  const TiledBlock block(simulate_block(options), 12, {}, 0.05);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  GlobalOptions exact;
  exact.max_decrement = 1e-6;
  GlobalState state = start_global(exact);
  adjust_globally(runner, exact, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  const TileState solution = block.gathered(runner.problems(), runner.states());
  const MonolithicSystem system = monolithic_system(block.whole, solution);
  const Eigen::VectorXd scaled_gradient =
      system.gradient().cwiseQuotient(system.diagonal().cwiseSqrt());  // in units of the conditional sigmas
  EXPECT_LE(scaled_gradient.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 1e-6);
}

}  // namespace
}  // namespace megablock
