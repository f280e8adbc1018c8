// The global iteration ends at the optimum of one monolithic Ceres problem; memory modes change no bit.
#include "merge/tree/global_adjustment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "merge/checks/monolithic.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/ceres_cost.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

SimulationOptions scene(SimulationOptions::Scene kind, std::int64_t frames) {
  SimulationOptions o;
  o.scene = kind;
  o.frames = frames;
  o.points_per_frame = 80;
  o.rig_cameras = 2;
  return o;
}

GlobalOptions exact() {
  GlobalOptions options;
  options.max_decrement = 1e-7;
  return options;
}

class SameOptimum : public testing::TestWithParam<SimulationOptions::Scene> {};

TEST_P(SameOptimum, AsOneCeresProblem) {
  const TiledBlock block(simulate_block(scene(GetParam(), 100)), 14, {}, 0.3);
  ASSERT_GE(block.tiles.tile_count, 8);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global(exact());
  adjust_globally(runner, exact(), state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  const TileState solution = block.gathered(runner.problems(), runner.states());
  EXPECT_LE(max_pose_difference_sigmas(block.whole, solution), 1e-6);
  const double cost = evaluate_cost(block.whole, solution);
  EXPECT_NEAR(cost_after_ceres(block.whole, solution, 100), cost, 1e-9 * cost);
}

// What stands in for the dense covariance of a large block.
TEST(MonolithicReference, DividesByTheSigmasThatAreGiven) {
  const TiledBlock block(simulate_block(scene(SimulationOptions::Scene::kStreet, 30)), 30, {}, 0.3);
  MergeTree alone;
  alone.nodes.push_back({-1, -1, -1, TileIndex(0), 0});
  const TileState start = block.gathered(block.problems, block.states);
  MergeInMemory whole(alone, {block.whole}, {start});
  whole.up(0);
  const auto largest = [&](const std::optional<FrameSigmas>& sigmas) {
    return max_pose_difference_sigmas(block.whole, start, whole.block_gauge(), whole.tile_plans().front(), sigmas);
  };
  const MonolithicSystem system = monolithic_system(block.whole, start);
  const Eigen::VectorXd variances = monolithic_covariance(system).diagonal();
  FrameSigmas sigmas = FrameSigmas::Zero(6, std::ssize(system.frame_column));
  for (std::size_t f = 0; f < system.frame_column.size(); ++f)
    sigmas.col(static_cast<Eigen::Index>(f)) = 2 * variances.segment<6>(system.frame_column[f]).cwiseSqrt();
  const double dense = largest(std::nullopt);
  EXPECT_GT(dense, 0.1);
  EXPECT_NEAR(largest(sigmas), dense / 2, 1e-9 * dense);
  sigmas(3, 7) = std::nan("");
  EXPECT_THROW(largest(sigmas), ComputeError);
}

TEST_P(SameOptimum, BoundaryFramesAgreeToTheBit) {
  const TiledBlock block(simulate_block(scene(GetParam(), 60)), 14, {}, 0.1);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global(exact());
  adjust_globally(runner, exact(), state);
  std::map<FrameIndex, Pose> seen;
  int shared = 0;
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    for (std::size_t r = 0; r < runner.problems()[t].frames.size(); ++r) {
      const Pose& pose = runner.states()[t].frames[r];
      const auto [entry, first] = seen.emplace(runner.problems()[t].frames[r], pose);
      if (first) continue;
      ++shared;
      EXPECT_EQ(entry->second.rotation.coeffs(), pose.rotation.coeffs());
      EXPECT_EQ(entry->second.centre, pose.centre);
    }
  }
  EXPECT_GT(shared, 10);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SameOptimum,
                         testing::Values(SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet),
                         [](const auto& p) {
                           return p.param == SimulationOptions::Scene::kAerial ? "Aerial" : "Street";
                         });

// Every loss, with and without shared calibration, with priors and free.
struct OptimumCase {
  SimulationOptions::Scene scene;
  RobustLoss::Kind loss;
  bool shared, free;
};

class EveryOptimum : public testing::TestWithParam<OptimumCase> {};

SimulatedBlock block_of(const OptimumCase& c) {
  SimulationOptions options = scene(c.scene, 70);
  options.calibrate = c.shared;
  if (c.free) options.gps_sigma_m = 0;
  SimulatedBlock block = simulate_block(options);
  if (!c.shared) return block;
  for (Rig& rig : block.block.rigs)
    for (std::size_t m = 1; m < rig.mounts.size(); ++m) {
      rig.mounts[m].rotation_sigma_rad = 0.01;
      rig.mounts[m].position_sigma_m = 0.05;
    }
  return block;
}

TEST_P(EveryOptimum, AsOneCeresProblem) {
  ObservationOptions observations;
  observations.image_loss = {GetParam().loss, 3};
  observations.position_loss = {GetParam().loss, 3};
  const TiledBlock block(block_of(GetParam()), 14, observations, 0.02);
  ASSERT_GE(block.tiles.tile_count, 5);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global(exact());
  adjust_globally(runner, exact(), state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  EXPECT_EQ(runner.block_gauge().free(), GetParam().free);

  const TileState solution = block.gathered(runner.problems(), runner.states());
  MergeTree alone;
  alone.nodes.push_back({-1, -1, -1, TileIndex(0), 0});
  MergeInMemory whole(alone, {block.whole}, {solution});
  whole.up(0);
  EXPECT_LE(max_pose_difference_sigmas(block.whole, solution, whole.block_gauge(), whole.tile_plans().front()), 1e-6);
  const double cost = evaluate_cost(block.whole, solution);
  EXPECT_NEAR(cost_after_ceres(block.whole, solution, 30), cost, 1e-9 * cost);
}

std::vector<OptimumCase> every_case() {
  std::vector<OptimumCase> cases;
  for (const auto scene : {SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet})
    for (const auto loss : {RobustLoss::Kind::kHuber, RobustLoss::Kind::kCauchy})
      for (const bool shared : {false, true})
        for (const bool free : {false, true}) cases.push_back({scene, loss, shared, free});
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Cases, EveryOptimum, testing::ValuesIn(every_case()), [](const auto& p) {
  return std::string(p.param.scene == SimulationOptions::Scene::kAerial ? "Aerial" : "Street") +
         (p.param.loss == RobustLoss::Kind::kHuber ? "Huber" : "Cauchy") + (p.param.shared ? "Shared" : "Held") +
         (p.param.free ? "Free" : "Priors");
});

bool same_bits(const TileState& a, const TileState& b) {
  const auto same_pose = [](const Pose& x, const Pose& y) {
    return x.rotation.coeffs() == y.rotation.coeffs() && x.centre == y.centre;
  };
  return std::equal(a.frames.begin(), a.frames.end(), b.frames.begin(), b.frames.end(), same_pose) &&
         std::equal(a.mounts.begin(), a.mounts.end(), b.mounts.begin(), b.mounts.end(), same_pose) &&
         a.cameras == b.cameras && a.points == b.points;
}

class MemoryTest : public testing::Test {
 protected:
  MemoryTest() : block_(simulate_block(scene(SimulationOptions::Scene::kAerial, 90)), 12, {}, 0.1) {}
  std::unique_ptr<MergeInMemory> run(const MemoryOptions& memory) {
    auto runner = std::make_unique<MergeInMemory>(block_.tiles.tree, block_.problems, block_.states, memory);
    GlobalState state = start_global({});
    adjust_globally(*runner, {}, state);
    EXPECT_EQ(state.outcome, GlobalOutcome::kConverged);
    return runner;
  }
  void expect_same(MergeInMemory& a, MergeInMemory& b) {
    a.final_up();
    b.final_up();
    const std::vector<TileCovariance>&ca = a.covariances(), &cb = b.covariances();
    for (std::size_t t = 0; t < a.states().size(); ++t) {
      EXPECT_TRUE(same_bits(a.states()[t], b.states()[t])) << "tile " << t;
      for (std::size_t f = 0; f < ca[t].frames.size(); ++f) EXPECT_EQ(ca[t].frames[f], cb[t].frames[f]);
      for (std::size_t p = 0; p < ca[t].points.size(); ++p) EXPECT_EQ(ca[t].points[p], cb[t].points[p]);
    }
  }
  TiledBlock block_;
};

TEST_F(MemoryTest, SpillGivesTheBitsOfKeep) {
  const ScratchDirectory scratch;
  const std::string folder = scratch.path("spill");
  {
    auto keep = run({}), spill = run({1 << 16, std::make_shared<ScratchSpace>(folder)});
    EXPECT_EQ(keep->memory().spilled, 0);
    EXPECT_GT(spill->memory().spilled, 10);
    EXPECT_EQ(spill->memory().recomputed, 0);
    EXPECT_LT(spill->memory().peak_bytes, keep->memory().peak_bytes / 3);
    expect_same(*keep, *spill);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder));
}

TEST_F(MemoryTest, RecomputingGivesTheBitsOfKeep) {
  auto keep = run({}), recompute = run({1 << 16});
  EXPECT_GT(recompute->memory().recomputed, 10);
  EXPECT_EQ(recompute->memory().spilled, 0);
  EXPECT_LT(recompute->memory().peak_bytes, keep->memory().peak_bytes / 3);
  expect_same(*keep, *recompute);
}

// Stopping after any accepted iteration and starting again from the stored state gives the same bits.
TEST_F(MemoryTest, ResumesFromAStoredState) {
  MergeInMemory whole(block_.tiles.tree, block_.problems, block_.states);
  GlobalState end = start_global(exact());
  adjust_globally(whole, exact(), end);
  ASSERT_GE(end.accepted, 3);
  struct Stop {};
  GlobalState state = start_global(exact());
  auto tiles = block_.states;
  for (bool running = true; running;) {
    MergeInMemory part(block_.tiles.tree, block_.problems, tiles);
    try {
      adjust_globally(part, exact(), state, [&](const GlobalState& s) {
        if (s.next != GlobalAction::kStop) throw Stop();
      });
      running = false;
    } catch (const Stop&) {
    }
    tiles = part.states();
  }
  EXPECT_EQ(state.cost, end.cost);
  EXPECT_EQ(state.accepted, end.accepted);
  for (std::size_t t = 0; t < tiles.size(); ++t) EXPECT_TRUE(same_bits(tiles[t], whole.states()[t]));
}

// A runner with prescribed answers: the controller alone.
GlobalState after(const GlobalOptions& options, const std::vector<std::pair<double, double>>& cost_and_decrement) {
  GlobalState state = start_global(options);
  for (std::size_t i = 0; i < cost_and_decrement.size() && state.next != GlobalAction::kStop;) {
    UpReport up;
    up.sums.cost = cost_and_decrement[i].first;
    up.sums.decrement_squared = std::pow(cost_and_decrement[i].second, 2);
    report_up(state, options, up);
    if (state.next == GlobalAction::kUp) continue;  // the same state with lambda = 0
    if (state.next == GlobalAction::kStop) break;
    if (++i == cost_and_decrement.size()) break;
    report_down(state, options, {0.0, cost_and_decrement[i].first});
    if (state.next == GlobalAction::kAccept) report_accepted(state, options);
    if (state.next == GlobalAction::kReject) report_rejected(state, options);
  }
  return state;
}

TEST(GlobalController, StopsOnTheDecrementOnly) {
  // The cost stands still to 13 digits, the block is two sigmas off: it must go on.
  EXPECT_EQ(after({}, {{1e9, 3.0}, {1e9 - 1e-4, 2.0}, {1e9 - 2e-4, 1.5}}).outcome, GlobalOutcome::kRunning);
  EXPECT_EQ(after({}, {{1e9, 3.0}, {1e9 - 4.5, 5e-5}}).outcome, GlobalOutcome::kConverged);
}

TEST(GlobalController, StopsWhereTheDecrementNoLongerFalls) {
  GlobalOptions options;
  options.max_decrement = 1e-12;
  EXPECT_EQ(after(options, {{1e9, 1e-4}, {1e9, 1e-6}, {1e9, 1e-6}}).outcome, GlobalOutcome::kRoundingFloor);
}

TEST(GlobalController, RaisesLambdaOnRejectionAndGivesUp) {
  GlobalOptions options;
  GlobalState state = start_global(options);
  for (int i = 0; i < 60 && state.next != GlobalAction::kStop; ++i) {
    UpReport up;
    up.sums.cost = 100;
    up.sums.decrement_squared = 50;
    report_up(state, options, up);
    const double before = state.lambda;
    report_down(state, options, {0.0, std::numeric_limits<double>::infinity()});
    ASSERT_EQ(state.next, GlobalAction::kReject);
    report_rejected(state, options);
    EXPECT_GE(state.lambda, 10 * before);
    if (i == 0) {
      EXPECT_NEAR(state.lambda, 1e-6, 1e-12);
    }
  }
  EXPECT_EQ(state.outcome, GlobalOutcome::kFailed);
}

// A pass with lambda = 0 that does not confirm, and whose step is no good, must not be asked for again at the same
// state.
TEST(GlobalController, GoesOnDampedWhereTheUndampedStepFails) {
  GlobalState state = start_global({});
  UpReport damped, undamped;
  damped.sums.cost = undamped.sums.cost = 100;
  damped.sums.decrement_squared = 1e-10;
  undamped.sums.decrement_squared = 1e-2;
  report_up(state, {}, damped);
  ASSERT_EQ(state.next, GlobalAction::kUp);
  EXPECT_EQ(next_sweep(state).lambda, 0);
  EXPECT_FALSE(next_sweep(state).curvature);
  report_up(state, {}, undamped);
  ASSERT_EQ(state.next, GlobalAction::kDown);
  report_down(state, {}, {0.0, 200.0});
  ASSERT_EQ(state.next, GlobalAction::kReject);
  report_rejected(state, {});
  report_up(state, {}, damped);
  ASSERT_EQ(state.next, GlobalAction::kDown);  // the damped step, small as it is
  EXPECT_GT(next_sweep(state).lambda, 0);
  report_down(state, {}, {0.0, 100 - 1e-11});
  ASSERT_EQ(state.next, GlobalAction::kAccept);
  report_accepted(state, {});
  report_up(state, {}, damped);
  EXPECT_EQ(next_sweep(state).lambda, 0);
}

TEST(GlobalController, TakesTheCurvatureOfTheLossesWhileItsModelHolds) {
  GlobalState state = start_global({});
  UpReport up;
  up.sums.cost = 100;
  up.sums.decrement_squared = 2;
  report_up(state, {}, up);
  EXPECT_FALSE(next_sweep(state).curvature);
  report_down(state, {}, {0.0, 99.0});
  report_accepted(state, {});
  EXPECT_TRUE(next_sweep(state).curvature);
  up.sums.cost = 99;
  report_up(state, {}, up);
  report_down(state, {}, {0.0, 98.9});  // a tenth of what was promised
  report_accepted(state, {});
  EXPECT_FALSE(next_sweep(state).curvature);
}

TEST(GlobalController, BeginsAgainWithTheDampingThatItHasReached) {
  GlobalState fallen = after({}, {{1e9, 3.0}, {1e9 - 4.5, 1.0}, {1e9 - 5, 0.1}});
  ASSERT_EQ(fallen.accepted, 2);
  ASSERT_LT(fallen.lambda, 2e-11);
  fallen.held = 5;
  const GlobalState again = start_again(fallen, {});
  EXPECT_EQ(next_sweep(again).lambda, fallen.lambda);
  EXPECT_EQ(again.lambda, fallen.lambda);
  EXPECT_EQ(again.accepted, 2);
  EXPECT_EQ(again.held, 5);
  EXPECT_EQ(again.iterations, 0);
  EXPECT_EQ(again.outcome, GlobalOutcome::kRunning);
  EXPECT_EQ(next_action(again), GlobalAction::kUp);

  const GlobalState raised = after({}, {{1e9, 3.0}, {2e9, 3.0}});  // a step that is rejected
  ASSERT_GE(raised.lambda, 1e-6 * (1 - 1e-12));
  EXPECT_EQ(next_sweep(start_again(raised, {})).lambda, GlobalOptions().initial_lambda);
}

// Without confirmation a pass may stop, unless damping makes its decrement small.
TEST(GlobalController, StopsUnconfirmedWhereItIsHardlyDamped) {
  GlobalOptions options;
  options.max_decrement = 0.1;
  options.confirm = false;
  UpReport up;
  up.sums.cost = 100;
  up.sums.decrement_squared = 1e-4;
  GlobalState state = start_global(options);
  report_up(state, options, up);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged);
  options.initial_lambda = 1;
  state = start_global(options);
  report_up(state, options, up);
  ASSERT_EQ(state.next, GlobalAction::kUp);
  EXPECT_EQ(next_sweep(state).lambda, 0);
  report_up(state, options, up);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged);
}

// The last permitted step decides like any other whether it was negligible.
TEST(GlobalController, ConvergesWithItsLastStep) {
  GlobalOptions options;
  options.function_tolerance = 1e-3;
  options.max_iterations = 2;
  const auto outcome_after = [&](double last_cost) {
    GlobalState state = start_global(options);
    for (const auto& [cost, trial_cost] : {std::pair(200.0, 100.0), std::pair(100.0, last_cost)}) {
      UpReport up;
      up.sums.cost = cost;
      up.sums.decrement_squared = cost;
      report_up(state, options, up);
      report_down(state, options, {0.0, trial_cost});
      EXPECT_EQ(state.next, GlobalAction::kAccept);
      report_accepted(state, options);
    }
    EXPECT_EQ(state.next, GlobalAction::kStop);
    return state.outcome;
  };
  EXPECT_EQ(outcome_after(99.99), GlobalOutcome::kConverged);
  EXPECT_EQ(outcome_after(60), GlobalOutcome::kIterationLimit);
}

TEST(GlobalController, RefusesBadOptions) {
  GlobalOptions options;
  options.max_decrement = 0;
  EXPECT_THROW(options.check(), InputError);
}

TEST(UpdateMatrixBytes, RoundTripAndTruncation) {
  Front front({}, {{{UnknownKind::kFrame, 0, 3}, 6}});
  for (int k = 0; k < 6; ++k) *front.place(k, k).values = k + 1;
  const UpdateMatrix update = std::move(front).eliminate(0).update;
  Bytes bytes = update.to_bytes();
  EXPECT_EQ(UpdateMatrix::from_bytes(bytes).matrix, update.matrix);
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, bytes.size() / 2, bytes.size() - 1}) {
    Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_THROW(UpdateMatrix::from_bytes(cut), StoreError);
  }
  bytes.push_back(0);
  EXPECT_THROW(UpdateMatrix::from_bytes(bytes), StoreError);
}

}  // namespace
}  // namespace megablock
