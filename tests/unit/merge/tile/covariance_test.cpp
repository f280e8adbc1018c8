// Covariances equal the inverse of the full normal equations; free blocks equal its pseudo-inverse after the same
// S-transformation.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>

#include "geometry/numbers/decompositions.h"
#include "merge/checks/monolithic.h"
#include "tests/support/adjust/known_lines.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/merge/tiled_block.h"
#include "tests/support/merge/two_cities.h"

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

// Of a street's ten cameras, whose neighbours see the same points.
SimulationOptions small_overlapping(SimulationOptions::Scene kind, std::int64_t frames, int points) {
  SimulationOptions o = small(kind, frames, points);
  if (kind == SimulationOptions::Scene::kStreet) o.rig_cameras = 10;
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
    for (std::size_t m = 0; m < problem.mounts.size(); ++m)
      if (problem.mount_free[m] && !tiles[t].mounts[m].isZero(0))
        compare(tiles[t].mounts[m], system.mount_column[TiledBlock::row(block.whole.mounts, problem.mounts[m])],
                "mount");
  }
}

// Dimension of the null space, and C = S H^+ S' with S from the same inner constraints, by eigenvalues of the dense H.
void expect_inner_covariances(const TiledBlock& block, MergeInMemory& runner, Eigen::Index defect, double tolerance) {
  ASSERT_EQ(runner.gauge().defect, defect);
  const std::vector<TileCovariance> covariances = runner.covariances();
  const MonolithicSystem system = monolithic_system(block.whole, block.gathered(runner.problems(), runner.states()));
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
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    const auto components =
        free_component_of_frame(runner.block_gauge(), static_cast<std::int64_t>(t), runner.tile_plans()[t]);
    for (std::size_t f = 0; f < components.size(); ++f)
      if (components[f] != nullptr)
        w.segment<6>(system.frame_column[TiledBlock::row(block.whole.frames, runner.problems()[t].frames[f])]) =
            components[f]->weights();
  }
  const Eigen::MatrixXd weighted = w.asDiagonal() * null;
  const Eigen::MatrixXd s =
      Eigen::MatrixXd::Identity(n, n) - null * solve_symmetric(null.transpose() * weighted, weighted.transpose());
  const Eigen::MatrixXd inner = s * any * s.transpose();
  expect_covariances(block, covariances, system, inner, tolerance);

  // All frames together, in the order of the table of frames.
  const CovarianceMatrix& joint = runner.frame_covariance();
  ASSERT_EQ(joint.unknowns.size(), block.whole.frames.size());
  std::vector<Eigen::Index> rows;
  for (const std::int64_t column : system.frame_column)
    for (Eigen::Index k = 0; k < 6; ++k) rows.push_back(column + k);
  const Eigen::MatrixXd expected = inner(rows, rows);
  const Eigen::Map<const Eigen::MatrixXd> ours(joint.matrix.data(), expected.rows(), expected.cols());
  const Eigen::VectorXd unit = expected.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LE((unit.asDiagonal() * (ours - expected) * unit.asDiagonal()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
            tolerance);

  // After the best-fit similarity of the positions, which is fitted part by part. With seven free directions the null
  // space is that of the similarities of one part.
  if (defect != 7) return;
  Eigen::VectorXd positions = w;
  for (const std::int64_t column : system.frame_column) positions.segment<3>(column).setZero();
  const Eigen::MatrixXd weighted_positions = positions.asDiagonal() * null;
  const Eigen::MatrixXd fit =
      Eigen::MatrixXd::Identity(n, n) -
      null * solve_symmetric(null.transpose() * weighted_positions, weighted_positions.transpose());
  const Eigen::MatrixXd aligned = fit * any * fit.transpose();
  for (std::size_t t = 0; t < covariances.size(); ++t)
    for (std::size_t f = 0; f < covariances[t].frames.size(); ++f) {
      const Eigen::Index column = system.frame_column[TiledBlock::row(block.whole.frames, block.problems[t].frames[f])];
      const Eigen::MatrixXd own = aligned.block<6, 6>(column, column);
      const Eigen::VectorXd scale = own.diagonal().cwiseSqrt().cwiseInverse();
      EXPECT_LE((scale.asDiagonal() * (covariances[t].aligned_frames[f] - own) * scale.asDiagonal())
                    .cwiseAbs()
                    .maxCoeff<Eigen::PropagateNaN>(),
                tolerance)
          << "tile " << t << " frame " << f;
    }
}

class Covariances : public testing::TestWithParam<SimulationOptions::Scene> {};

TEST_P(Covariances, EqualTheInverse) {
  const TiledBlock block(simulate_block(small_overlapping(GetParam(), 30, 24)), 8, {}, 0.02);
  ASSERT_GE(block.tiles.tile_count, 4);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
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

TEST_P(Covariances, OfAFreeBlockEqualThePseudoInverse) {
  SimulationOptions options = small_overlapping(GetParam(), 20, 20);
  options.gps_sigma_m = 0;
  options.calibrate = false;
  const TiledBlock block(simulate_block(options), 6, {}, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const UpReport up = runner.final_up();
  EXPECT_NE(runner.gauge().text.find("free"), std::string::npos);
  EXPECT_TRUE(up.sums.held.empty());
  const bool rig = GetParam() == SimulationOptions::Scene::kStreet;
  expect_inner_covariances(block, runner, rig ? 6 : 7, 1e-5);
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
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
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
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    runner.final_up();
    EXPECT_EQ(runner.gauge().defect, sigma > 1 ? 1 : 0) << "sigma " << sigma;
  }
}

TEST(Gauge, AttitudesLeaveShiftAndScale) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
  options.gps_sigma_m = 0;
  options.attitude_sigma_deg = 0.1;
  const TiledBlock block(simulate_block(options), 12, {}, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
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
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 5);
}

TEST(Gauge, VerticalsLeaveShiftScaleAndHeading) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 40, 40);
  options.gps_sigma_m = 0;
  SimulatedBlock simulated = simulate_block(options);
  add_seen_verticals(simulated, {.by_radial = 0.02, .every = 3});
  const TiledBlock block(std::move(simulated), 12, {}, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 5);
}

// The datum is a matter of convention: cost, decrement and the adjusted observations do not depend on it.
TEST(Gauge, FreeBlockReachesTheOptimum) {
  SimulationOptions options = small(SimulationOptions::Scene::kAerial, 60, 60);
  options.gps_sigma_m = 0;
  const TiledBlock block(simulate_block(options), 12, {}, 0.05);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
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

// Streets without priors; the second camera of the rig stands with these sigmas.
SimulatedBlock free_streets(double rotation_sigma_rad, double position_sigma_m) {
  SimulationOptions options = small(SimulationOptions::Scene::kStreet, 16, 40);
  options.gps_sigma_m = 0;
  options.calibrate = false;
  SimulatedBlock streets = simulate_block(options);
  Mount& mount = streets.block.rigs.front().mounts[1];
  mount.rotation_sigma_rad = rotation_sigma_rad;
  mount.position_sigma_m = position_sigma_m;
  return streets;
}

// The same streets twice, with other noise.
SimulatedBlock two_free_cities(double rotation_sigma_rad, double position_sigma_m) {
  SimulatedBlock cities = free_streets(rotation_sigma_rad, position_sigma_m), other = cities;
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, 300);  // 2^-10 px
  for (auto* values : {&other.tracks.x, &other.tracks.y})
    for (std::int32_t& value : *values) value += static_cast<std::int32_t>(std::lround(noise(random)));
  append_city(cities, other, {3000, 200, 10});
  return cities;
}

constexpr double kFree = std::numeric_limits<double>::infinity();

void adjust_exactly(MergeInMemory& runner, int most_steps) {
  GlobalOptions exact;
  exact.max_decrement = 1e-6;
  GlobalState state = start_global(exact);
  adjust_globally(runner, exact, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  EXPECT_LE(state.accepted, most_steps);
}

// The rig's reference stands beside the frame's centre: the scale moves the frame as it moves the reference.
TEST(Gauge, FreeMountsLeaveTheScale) {
  const TiledBlock block(free_streets(kFree, kFree), 6, {}, 0.02);
  ASSERT_GT(block.simulated.truth.mounts.front()[0].centre.norm(), 0.1);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  adjust_exactly(runner, 6);
  EXPECT_TRUE(runner.final_up().sums.held.empty());
  expect_inner_covariances(block, runner, 7, 1e-5);
}

// What changes the scale of one city changes the mounts, and with them that of the other.
TEST(Gauge, CitiesThatShareFreeMountsHaveOneScale) {
  const TiledBlock block(two_free_cities(kFree, kFree), 6, {}, 0.02);
  ASSERT_GE(block.tiles.tile_count, 4);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  adjust_exactly(runner, 6);
  EXPECT_TRUE(runner.final_up().sums.held.empty());
  ASSERT_EQ(runner.block_gauge().components.size(), 2u);
  EXPECT_NE(runner.gauge().text.find("parts that share a rig have one scale"), std::string::npos);
  expect_inner_covariances(block, runner, 13, 1e-5);

  // The optimum, by Ceres' derivatives.
  const MonolithicSystem system = monolithic_system(block.whole, block.gathered(runner.problems(), runner.states()));
  EXPECT_LE(system.gradient().cwiseQuotient(system.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
            1e-6);
  const TilePlan plan = make_lone_tile_plan(block.whole, block.whole.camera_free);
  const TileState solution = block.gathered(runner.problems(), runner.states());
  const BlockGauge gauge = make_gauge({tile_gauge(block.whole, plan, solution)});
  EXPECT_EQ(gauge.defect(), 13);
  EXPECT_LE(max_pose_difference_sigmas(block.whole, solution, gauge, plan), 1e-6);
}

// What is told of the scale, by the mounts or in one of the cities, holds for both.
TEST(Gauge, CitiesThatShareAKnownScale) {
  for (const bool positions : {false, true}) {
    SimulatedBlock cities = positions ? two_free_cities(kFree, kFree) : two_free_cities(0.01, 0.02);
    for (std::size_t f = 16; positions && f < 32; ++f) {
      const FrameIndex frame(static_cast<std::int64_t>(f));
      cities.block.frames[frame].position_prior = {cities.truth.frames[frame].centre, Eigen::Vector3d::Constant(0.05)};
    }
    const TiledBlock block(std::move(cities), 6, {}, 0.02);
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    adjust_exactly(runner, 6);
    EXPECT_TRUE(runner.final_up().sums.held.empty());
    expect_inner_covariances(block, runner, positions ? 6 : 12, 1e-5);
  }
}

}  // namespace
}  // namespace megablock
