// A tile adjusted by condensation against the same tile adjusted by Ceres, from the same poor start.
#include "merge/tree/tile_solver.h"

#include <gtest/gtest.h>

#include "adjust/lanes/observation_lanes.h"
#include "adjust/lanes/tile_cost.h"
#include "merge/checks/monolithic.h"
#include "merge/datum/gauge.h"
#include "tests/support/adjust/single_tile.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

constexpr SolveOptions kTight{300, 1e-15, {}};

SimulationOptions tile_scene(SimulationOptions::Scene kind, std::uint64_t seed) {
  SimulationOptions options;
  options.scene = kind;
  options.frames = 30;
  options.points_per_frame = kind == SimulationOptions::Scene::kAerial ? 100 : 300;
  options.seed = seed;
  options.start_position_error_m = 2;
  options.start_rotation_error_deg = 1;
  return options;
}
SimulationOptions aerial_tile(std::uint64_t seed) { return tile_scene(SimulationOptions::Scene::kAerial, seed); }
SimulationOptions street_tile(std::uint64_t seed) { return tile_scene(SimulationOptions::Scene::kStreet, seed); }

// A tile with its points intersected at the poor poses, ready to be solved.
struct Start : SingleTile {
  explicit Start(const SimulationOptions& simulation) : SingleTile(simulation) {
    triangulate_points(problem, state, options);
  }
  void free_mounts() {
    for (std::size_t m = 1; m < problem.mounts.size(); ++m) problem.mount_free[m] = 1;
  }
};

// The problem with other intrinsics estimated, for references that know no masks.
TileProblem with_free(TileProblem problem, const std::vector<ParameterMask>& camera_free) {
  if (!camera_free.empty()) problem.camera_free = camera_free;
  return problem;
}

void expect_same_meaning(const AdjustSummary& ours, const AdjustSummary& reference) {
  EXPECT_TRUE(ours.usable) << ours.text;
  EXPECT_EQ(ours.observations, reference.observations);
  EXPECT_EQ(ours.points, reference.points);
  EXPECT_EQ(ours.degrees_of_freedom, reference.degrees_of_freedom);
  EXPECT_NEAR(ours.initial_cost, reference.initial_cost, 1e-9 * reference.initial_cost);
}

// At our optimum the undamped step of one monolithic system (Jacobians of Ceres) is nothing, in posterior sigmas, and
// the cost is the one that Ceres ends with.
void expect_optimum_of_ceres(const Start& start, const SolveOptions& options = kTight) {
  TileState ours = start.state, reference = start.state;
  const AdjustSummary summary = solve_by_condensation(start.problem, ours, options);
  AdjustSummary expected = solve_with_ceres(start.problem, reference, options);
  expect_same_meaning(summary, expected);
  if (expected.final_cost > (1 + 1e-6) * summary.final_cost) {  // in another minimum, a worse one: from ours it stays
    reference = ours;
    expected = solve_with_ceres(start.problem, reference, options);
  }
  EXPECT_NEAR(summary.final_cost, expected.final_cost, 1e-6 * expected.final_cost) << summary.text;
  EXPECT_NEAR(summary.final_cost, evaluate_cost(start.problem, ours), 1e-12 * summary.final_cost);
  EXPECT_NEAR(summary.sigma0, expected.sigma0, 1e-3);

  const TileProblem problem = with_free(start.problem, options.camera_free);
  const TilePlan plan = make_lone_tile_plan(problem, problem.camera_free);
  const BlockGauge gauge = make_gauge({tile_gauge(problem, plan, ours)});
  EXPECT_LT(max_pose_difference_sigmas(problem, ours, gauge, plan), 1e-3) << summary.text;
}

TEST(TileSolver, AerialWithItsCamera) { expect_optimum_of_ceres(Start(aerial_tile(1))); }

// One point is measured seven times in every image that sees it.
TEST(TileSolver, TracksOfMoreObservationsThanLanes) {
  Start start(aerial_tile(1));
  TileProblem& problem = start.problem;
  std::int64_t longest = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (problem.begin[p + 1] - problem.begin[p] > problem.begin[longest + 1] - problem.begin[longest]) longest = p;
  const std::int64_t first = problem.begin[longest], count = problem.begin[longest + 1] - first;
  const auto repeat = [&](auto& column) {
    const std::vector<std::decay_t<decltype(column[0])>> rows(column.begin() + first, column.begin() + first + count);
    for (int k = 0; k < 6; ++k) column.insert(column.begin() + first, rows.begin(), rows.end());
  };
  repeat(problem.image);
  repeat(problem.x);
  repeat(problem.y);
  repeat(problem.inverse_sigma);
  repeat(problem.kept);
  for (std::size_t p = static_cast<std::size_t>(longest) + 1; p < problem.begin.size(); ++p)
    problem.begin[p] += 6 * count;
  ASSERT_GT(7 * count, ObservationLanes::kUsual);
  expect_optimum_of_ceres(start);
}

TEST(TileSolver, StreetWithItsRigHeld) {
  SimulationOptions simulation = street_tile(2);
  simulation.calibrate = false;
  expect_optimum_of_ceres(Start(simulation));
}

TEST(TileSolver, StreetWithFreeMounts) {
  SimulationOptions simulation = street_tile(3);
  simulation.start_position_error_m = 1;  // farther away lie other minima of a narrow loss, for Ceres as for us
  simulation.start_rotation_error_deg = 0.5;
  Start start(simulation);
  start.free_mounts();
  expect_optimum_of_ceres(start);
}

TEST(TileSolver, PriorsOfAllKinds) {
  SimulationOptions simulation = street_tile(4);
  simulation.gps_share = 0.5;
  simulation.attitude_sigma_deg = 0.1;
  simulation.relative_position_sigma_m = 0.02;
  simulation.control_points = 8;
  Start start(simulation);
  start.free_mounts();
  for (std::size_t m = 1; m < start.problem.mounts.size(); ++m)
    start.problem.mount_priors.push_back({static_cast<std::int32_t>(m), start.state.mounts[m], 0.002, 0.01});
  for (std::size_t c = 0; c < start.problem.cameras.size(); ++c) {
    TileProblem::IntrinsicTerm term{LocalCamera(static_cast<std::int32_t>(c)), start.state.cameras[c], {}};
    term.sigma.fill(std::numeric_limits<double>::infinity());
    term.sigma[0] = 5;
    start.problem.intrinsic_priors.push_back(term);
  }
  for (std::size_t f = 0; f < start.problem.frames.size(); f += 3) {
    TileProblem::LineTerm line;
    line.frame = LocalFrame(static_cast<std::int32_t>(f));
    const Eigen::Vector3d up = start.truth().frames[f].rotation * Eigen::Vector3d::UnitZ();
    line.middle = up.unitOrthogonal();
    line.across = up.cross(line.middle);
    line.weight = 300;
    start.problem.lines.push_back(line);
  }
  start.problem.attitude_loss = {RobustLoss::Kind::kCauchy, 2};
  start.problem.relative_loss = {RobustLoss::Kind::kHuber, 2};
  expect_optimum_of_ceres(start);
}

TEST(TileSolver, FreeDatum) {
  for (const bool rig : {false, true}) {
    SimulationOptions simulation = rig ? street_tile(5) : aerial_tile(5);
    simulation.gps_sigma_m = 0;
    simulation.calibrate = false;
    simulation.start_position_error_m = 0.5;
    const Start start(simulation);
    TileState state = start.state;
    const AdjustSummary summary = solve_by_condensation(start.problem, state, kTight);
    EXPECT_EQ(summary.degrees_of_freedom,
              2 * summary.observations - 3 * summary.points - 6 * std::ssize(start.problem.frames) + (rig ? 6 : 7));
    expect_optimum_of_ceres(start);
  }
}

TEST(TileSolver, LossesOfAllKinds) {
  for (const RobustLoss& loss :
       {RobustLoss{}, RobustLoss{RobustLoss::Kind::kCauchy, 3}, RobustLoss{RobustLoss::Kind::kCauchyTail, 3}}) {
    Start start(aerial_tile(6));
    start.problem.image_loss = loss;
    expect_optimum_of_ceres(start);
  }
}

// One of eight control points is off by two metres, where a centimetre is stated, and all others are as stated.
TEST(TileSolver, LossOfControlPoints) {
  SimulationOptions simulation = aerial_tile(11);
  simulation.control_points = 8;
  for (const auto kind : {RobustLoss::Kind::kHuber, RobustLoss::Kind::kCauchyTail}) {
    Start start(simulation);
    ASSERT_EQ(start.problem.point_priors.size(), 8u);
    start.problem.point_priors[3].position.x() += 2;
    start.problem.control_loss = {kind, 3};
    expect_optimum_of_ceres(start);
  }
}

// The tile's own adjustment estimates fewer intrinsics than the block.
TEST(TileSolver, MasksOfIntrinsics) {
  const Start start(aerial_tile(7));
  SolveOptions options = kTight;
  options.camera_free = {start.problem.camera_free.front() & ParameterMask{3}};
  ASSERT_NE(options.camera_free.front(), start.problem.camera_free.front());
  expect_optimum_of_ceres(start, options);
  TileState state = start.state;
  solve_by_condensation(start.problem, state, options);
  for (int k = 0; k < state.cameras[0].size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    EXPECT_EQ(state.cameras[0][i] != start.state.cameras[0][i], contains(options.camera_free.front(), k)) << k;
  }
  options.camera_free = {0};
  expect_optimum_of_ceres(start, options);
}

TEST(TileSolver, LeavesPointsThatTakeNoPart) {
  Start start(street_tile(8));
  constexpr std::int64_t kHeldOut = 5;
  for (std::int64_t row = start.problem.begin[kHeldOut]; row < start.problem.begin[kHeldOut + 1]; ++row)
    start.problem.kept[row] = 0;
  start.state.points[kHeldOut].setConstant(std::numeric_limits<double>::quiet_NaN());
  expect_optimum_of_ceres(start);
}

TEST(TileSolver, OneFrameOnControlPoints) {
  SimulationOptions simulation = aerial_tile(9);
  simulation.control_points = 12;
  simulation.calibrate = false;
  Start start(simulation);
  TileState truth = start.truth();
  std::vector<std::int64_t> seen(start.problem.frames.size(), 0);
  const auto frame_of = [&](std::int64_t row) {
    return start.problem.images[start.problem.image[row].value].frame.value;
  };
  for (const auto& term : start.problem.point_priors)
    for (std::int64_t row = start.problem.begin[term.point.value]; row < start.problem.begin[term.point.value + 1];
         ++row)
      ++seen[frame_of(row)];
  const auto most = std::max_element(seen.begin(), seen.end()) - seen.begin();
  ASSERT_GE(seen[most], 4);
  start.problem.kept.assign(start.problem.kept.size(), 0);
  start.problem.positions.clear();
  for (const auto& term : start.problem.point_priors) {
    start.state.points[term.point.value] = term.position;
    for (std::int64_t row = start.problem.begin[term.point.value]; row < start.problem.begin[term.point.value + 1];
         ++row)
      start.problem.kept[row] = frame_of(row) == most;
  }
  const AdjustSummary summary = solve_by_condensation(start.problem, start.state, kTight);
  EXPECT_TRUE(summary.usable) << summary.text;
  EXPECT_EQ(summary.degrees_of_freedom, 2 * seen[most] - 6);
  EXPECT_LT((start.state.frames[most].centre - truth.frames[most].centre).norm(), 1);
}

TEST(TileSolver, SaysWhenAPointLiesBehindItsCamera) {
  Start start(aerial_tile(10));
  start.state.points[0].z() += 500;
  const TileState before = start.state;
  const AdjustSummary summary = solve_by_condensation(start.problem, start.state, {});
  EXPECT_FALSE(summary.usable);
  EXPECT_NE(summary.text.find("behind"), std::string::npos) << summary.text;
  EXPECT_EQ(start.state.frames[0].centre, before.frames[0].centre);
  EXPECT_EQ(start.state.points, before.points);
}

TEST(TileSolver, RefusesNothing) {
  Start start(aerial_tile(11));
  start.problem.kept.assign(start.problem.kept.size(), 0);
  start.problem.positions.clear();
  start.problem.intrinsic_priors.clear();
  EXPECT_THROW(solve_by_condensation(start.problem, start.state, {}), ComputeError);
  EXPECT_THROW(adjust_tile(start.problem, start.state, start.options, solve_by_condensation), ComputeError);
}

TEST(TileSolver, EndsWhenTheCostHardlyFalls) {
  const Start start(aerial_tile(13));
  TileState rough = start.state, fine = start.state;
  const AdjustSummary few = solve_by_condensation(start.problem, rough, {300, 1e-2, {}});
  const AdjustSummary many = solve_by_condensation(start.problem, fine, kTight);
  EXPECT_LT(few.iterations, many.iterations);
  EXPECT_GE(few.final_cost, many.final_cost);
  EXPECT_LT(few.final_cost, 1.03 * many.final_cost);
  TileState one = start.state;
  EXPECT_EQ(solve_by_condensation(start.problem, one, {1, 1e-15, {}}).iterations, 1);
}

// Points are behind cameras after many of the first steps.
TEST(TileSolver, WholeAdjustmentFromAPoorStart) {
  for (SimulationOptions simulation : {aerial_tile(12), street_tile(12)}) {
    simulation.start_position_error_m = 3;
    simulation.start_rotation_error_deg = 3;
    simulation.outlier_share = 0.1;
    simulation.points_per_frame = 500;  // more than the first approach takes
    SingleTile tile(simulation), again(simulation);
    const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options, solve_by_condensation);
    EXPECT_NEAR(summary.sigma0, 1, 0.05);
    EXPECT_LT(tile.position_rms(), 0.1);
    std::int64_t found = 0, wrong = 0;
    for (std::size_t row = 0; row < tile.simulated.outlier.size(); ++row) {
      wrong += tile.simulated.outlier[row];
      found += tile.simulated.outlier[row] && !tile.problem.kept[row];
    }
    EXPECT_GE(static_cast<double>(found), 0.97 * static_cast<double>(wrong));

    adjust_tile(again.problem, again.state, again.options, solve_by_condensation);
    EXPECT_EQ(tile.problem.kept, again.problem.kept);
    EXPECT_EQ(tile.state.frames.back().rotation.coeffs(), again.state.frames.back().rotation.coeffs());
  }
}

// Passes of a street that start up to 2 m apart, seen by many short and some common tracks: the tile is brought as near
// as a start for its block has to be, with the ties between the passes kept.
TEST(TileSolver, DenseTileAsAStart) {
  SimulationOptions simulation = street_tile(14);
  simulation.frames = 60;
  simulation.points_per_frame = 1000;
  simulation.calibrate = false;
  simulation.gps_sigma_m = 0.5;
  simulation.gps_share = 0.5;
  simulation.relative_position_sigma_m = 0.01;
  simulation.relative_rotation_sigma_deg = 0.01;
  simulation.start_position_error_m = 0;
  simulation.start_rotation_error_deg = 0;
  simulation.start_offset_m = 2;
  simulation.start_chain_frames = 20;
  SingleTile tile(simulation);
  tile.options.only_start = true;
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options, solve_by_condensation);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  const auto kept = std::count(tile.problem.kept.begin(), tile.problem.kept.end(), std::uint8_t{1});
  EXPECT_GT(static_cast<double>(kept), 0.995 * static_cast<double>(tile.problem.observation_count()));
  const TilePlan plan = make_lone_tile_plan(tile.problem, tile.problem.camera_free);
  const BlockGauge gauge = make_gauge({tile_gauge(tile.problem, plan, tile.state)});
  EXPECT_LT(max_pose_difference_sigmas(tile.problem, tile.state, gauge, plan), 1) << summary.text;
}

}  // namespace
}  // namespace megablock
