// Tiles with too little information or none: the block reaches the same optimum, and undetermined unknowns are held and
// reported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "cluster/stages/merge/merge_tiles.h"
#include "io/base/error.h"
#include "merge/checks/monolithic.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

SimulationOptions aerial_frames(std::int64_t frames) {
  SimulationOptions options;
  options.frames = frames;
  options.points_per_frame = 60;
  return options;
}

GlobalState adjusted(MergeInMemory& runner) {
  GlobalOptions exact;
  exact.max_decrement = 1e-7;
  GlobalState state = start_global(exact);
  adjust_globally(runner, exact, state);
  return state;
}

// The frames of the whole, each from a tile that has it as an unknown: the others do not follow it.
TileState solution_of(const TiledBlock& block, const MergeInMemory& runner) {
  TileState solution = block.gathered(runner.problems(), runner.states());
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    const TileProblem& problem = runner.problems()[t];
    for (std::size_t f = 0; f < problem.frames.size(); ++f)
      if (runner.tile_plans()[t].unknown_of_frame[f] >= 0)
        solution.frames[TiledBlock::row(block.whole.frames, problem.frames[f])] = runner.states()[t].frames[f];
  }
  return solution;
}

// Rejects every observation of the tiles for which it holds.
template <typename Predicate>
void reject_if(TiledBlock& block, const Predicate& wrong) {
  for (std::size_t t = 0; t < block.problems.size(); ++t)
    for (std::size_t o = 0; o < block.problems[t].kept.size(); ++o)
      if (wrong(block.problems[t], o, t)) block.problems[t].kept[o] = 0;
}

// The whole takes over what is kept in the tiles.
void follow(TiledBlock& block) {
  std::fill(block.whole.kept.begin(), block.whole.kept.end(), std::uint8_t{0});
  for (const TileProblem& problem : block.problems)
    for (std::size_t p = 0; p < problem.points.size(); ++p) {
      const auto target = block.whole.begin[block.point_row(problem.points[p])];
      std::copy(problem.kept.begin() + problem.begin[p], problem.kept.begin() + problem.begin[p + 1],
                block.whole.kept.begin() + target);
    }
}

TEST(BadTiles, TileWithoutObservations) {
  for (const bool priors : {true, false}) {
    TiledBlock block(simulate_block(aerial_frames(60)), 12, {}, 0.02);
    ASSERT_GE(block.tiles.tile_count, 4);
    constexpr std::size_t kEmpty = 1;
    reject_if(block, [](const TileProblem&, std::size_t, std::size_t tile) { return tile == kEmpty; });
    if (!priors) {
      const std::vector<FrameIndex>& own = block.problems[kEmpty].frames;
      std::vector<TileProblem::PositionTerm>& all = block.whole.positions;
      std::erase_if(all, [&](const TileProblem::PositionTerm& term) {
        const auto& dropped = block.problems[kEmpty].positions;
        return std::any_of(dropped.begin(), dropped.end(), [&](const TileProblem::PositionTerm& d) {
          return own[static_cast<std::size_t>(d.frame.value)] ==
                 block.whole.frames[static_cast<std::size_t>(term.frame.value)];
        });
      });
      block.problems[kEmpty].positions.clear();
      block.problems[kEmpty].intrinsic_priors.clear();
    }
    follow(block);
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    const GlobalState state = adjusted(runner);
    EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
    const TileState solution = solution_of(block, runner);
    const MonolithicSystem system = monolithic_system(block.whole, solution);
    const Eigen::ArrayXd gradient = system.gradient(), diagonal = system.diagonal();
    EXPECT_TRUE(((diagonal > 0) || (diagonal == 0 && gradient == 0)).all()) << "what nothing holds pulls at nothing";
    const Eigen::ArrayXd scaled = gradient / diagonal.max(std::numeric_limits<double>::min()).sqrt();
    EXPECT_LE(scaled.abs().maxCoeff<Eigen::PropagateNaN>(), 1e-6) << "priors " << priors;
    EXPECT_EQ(runner.final_up().sums.residuals, system.residual.size());
    for (const TileCovariance& tile : runner.covariances())
      for (const auto& covariance : tile.frames) EXPECT_TRUE(covariance.allFinite());
  }
}

// One observation and a position say five things of six: nothing of it is left for the others, the turn about the ray
// is held and said. Without the observation the frame is a part of its own, whose rotation is free.
TEST(BadTiles, FrameSeenByOnePoint) {
  const auto solve = [](bool without, GlobalState& state, UpReport& up, GaugeReport& gauge) {
    TiledBlock block(simulate_block(aerial_frames(60)), 12, {}, 0.005);
    const FrameIndex lonely(31);
    bool found = false;
    reject_if(block, [&](const TileProblem& problem, std::size_t o, std::size_t) {
      const TileImage& image = problem.images[static_cast<std::size_t>(problem.image[o].value)];
      if (problem.frames[static_cast<std::size_t>(image.frame.value)] != lonely) return false;
      return without || std::exchange(found, true);
    });
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    state = adjusted(runner);
    up = runner.final_up();
    for (const TileCovariance& tile : runner.covariances())
      for (const auto& covariance : tile.frames) EXPECT_TRUE(covariance.allFinite());
    gauge = runner.gauge();
    return solution_of(block, runner);
  };
  GlobalState with_state, without_state;
  UpReport with_up, without_up;
  GaugeReport with_gauge, without_gauge;
  const TileState with = solve(false, with_state, with_up, with_gauge),
                  without = solve(true, without_state, without_up, without_gauge);
  EXPECT_EQ(with_state.outcome, GlobalOutcome::kConverged) << describe(with_state);
  EXPECT_EQ(without_state.outcome, GlobalOutcome::kConverged) << describe(without_state);
  for (std::size_t f = 0; f < with.frames.size(); ++f) {
    if (f == 31) continue;
    EXPECT_LT((with.frames[f].centre - without.frames[f].centre).norm(), 1e-7) << f;
    EXPECT_LT(rotation_angle(with.frames[f].rotation, without.frames[f].rotation), 1e-9) << f;
  }
  const auto held_of = [](const UpReport& up) {
    return std::count_if(up.sums.held.begin(), up.sums.held.end(), [](const HeldUnknown& held) {
      return held.id == UnknownId{UnknownKind::kFrame, 0, 31};
    });
  };
  EXPECT_EQ(with_up.sums.held.size(), 1u);
  EXPECT_EQ(held_of(with_up), 1);
  EXPECT_EQ(with_gauge.undetermined, 1);
  EXPECT_EQ(with_gauge.defect, 0);
  EXPECT_NE(with_gauge.text.find("too few observations determine"), std::string::npos) << with_gauge.text;
  EXPECT_TRUE(without_up.sums.held.empty());
  EXPECT_EQ(without_gauge.defect, 3);
}

// Tiles of one or two images, without any prior: none has a datum of its own, the block has that of its inner
// constraints.
TEST(BadTiles, SingularTilesOfOneImage) {
  SimulationOptions options = aerial_frames(7);
  options.gps_sigma_m = 0;
  options.calibrate = false;
  const TiledBlock block(simulate_block(options), 2, {}, 0.01);
  std::vector<int> frames(static_cast<std::size_t>(block.tiles.tile_count), 0);
  for (const TileIndex tile : block.tiles.tile_of_frame) ++frames[static_cast<std::size_t>(tile.value)];
  ASSERT_EQ(*std::min_element(frames.begin(), frames.end()), 1);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const GlobalState state = adjusted(runner);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  const TileState solution = solution_of(block, runner);
  const MonolithicSystem system = monolithic_system(block.whole, solution);
  EXPECT_LE(system.gradient().cwiseQuotient(system.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(),
            1e-6);
  runner.final_up();
  EXPECT_EQ(runner.gauge().defect, 7);
}

// One image, no prior, no second one: every point is seen once and takes no part.
TEST(BadTiles, BlockOfOneImageWithoutPriors) {
  SimulationOptions options = aerial_frames(20);
  options.gps_sigma_m = 0;
  TiledBlock block(simulate_block(options), 30, {}, 0);
  ASSERT_EQ(block.problems.size(), 1u);
  reject_if(block, [](const TileProblem& problem, std::size_t o, std::size_t) { return problem.image[o].value != 0; });
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const GlobalState state = adjusted(runner);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  EXPECT_EQ(runner.final_up().sums.residuals, 0);
  EXPECT_EQ(runner.states().front().frames.front().centre, block.states.front().frames.front().centre);
}

TEST(BadTiles, NumbersThatAreNoneAreRefused) {
  for (const double wrong : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    TiledBlock block(simulate_block(aerial_frames(20)), 10, {}, 0);
    TileProblem& problem = block.problems.back();
    problem.x[static_cast<std::size_t>(problem.begin[3])] = wrong;
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    try {
      runner.up(0);
      ADD_FAILURE() << "taken";
    } catch (const ComputeError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("the observation of point " +
                                                   std::to_string(problem.points[3].index) + " in image "));
    }
  }
}

}  // namespace
}  // namespace megablock
