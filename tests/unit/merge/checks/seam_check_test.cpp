#include "merge/checks/seam_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>

#include "adjust/tile/image_sigma.h"
#include "adjust/tile/tile_adjustment.h"
#include "merge/checks/seam_text.h"
#include "tests/support/merge/tiled_block.h"
#include "tests/support/merge/turned_frames.h"

namespace megablock {
namespace {

SimulationOptions clean_scene() {
  SimulationOptions o;
  o.frames = 60;
  o.points_per_frame = 60;
  o.gps_sigma_m = 0.2;
  o.calibrate = false;
  return o;
}

ObservationOptions without_loss() {
  ObservationOptions options;
  options.image_loss.kind = options.position_loss.kind = RobustLoss::Kind::kNone;
  return options;
}

void adjust(MergeInMemory& runner) {
  GlobalOptions options;
  options.max_decrement = 1e-4;
  GlobalState state = start_global(options);
  adjust_globally(runner, options, state);
  ASSERT_EQ(state.outcome, GlobalOutcome::kConverged);
  runner.final_up();
}

// As a job does: robust losses, the sigma of the measurements estimated from all residuals, observations tested again.
std::unique_ptr<MergeInMemory> adjusted_as_a_job(const TiledBlock& block, std::vector<TileProblem> problems) {
  const AdjustOptions options;
  std::vector<TileState> states = block.states;
  for (int round = 0; round < 2; ++round) {
    MergeInMemory runner(block.tiles.tree, problems, states);
    adjust(runner);
    states = runner.states();
    ImageResiduals residuals;
    for (std::size_t t = 0; t < problems.size(); ++t) residuals.add(image_residuals(problems[t], states[t], options));
    const auto unknowns = 6 * std::ssize(block.whole.frames);
    for (std::size_t t = 0; t < problems.size(); ++t) {
      set_image_sigma(problems[t], image_sigma(residuals, unknowns).value());
      screen_observations(problems[t], states[t], options.max_residual_sigmas, options);
    }
  }
  auto runner = std::make_unique<MergeInMemory>(block.tiles.tree, std::move(problems), std::move(states));
  adjust(*runner);
  return runner;
}

// Over all seams and several blocks the sum of T is chi-square distributed with the sum of the degrees.
TEST(SeamCheck, HasItsChiSquareMeanOnCleanData) {
  double statistic = 0, degrees = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions options = clean_scene();
    options.seed = seed;
    const TiledBlock block(simulate_block(options), 12, without_loss(), 0.02);
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    adjust(runner);
    ASSERT_GE(runner.seams().size(), 4u);
    for (const SeamReport& seam : runner.seams()) {
      EXPECT_FALSE(seam.alarm()) << "T " << seam.statistic << " of " << seam.degrees;
      statistic += seam.statistic;
      degrees += static_cast<double>(seam.degrees);
    }
    EXPECT_TRUE(describe_seams(block.tiles.tree, runner.seams(), runner.tile_checks()).empty());
    EXPECT_TRUE(describe_disagreements(runner.tile_checks()).empty());
  }
  EXPECT_GT(degrees, 500);
  EXPECT_NEAR(statistic, degrees, 5 * std::sqrt(2 * degrees));
}

// Of two tiles, each against the rest is the seam between them; also where one has no datum of its own.
TEST(SeamCheck, ComparesEachOfTwoTilesWithTheOtherAsTheirSeamDoes) {
  for (const bool free : {false, true}) {
    TiledBlock block(simulate_block(clean_scene()), 32, without_loss(), 0.02);
    ASSERT_EQ(block.problems.size(), 2u);
    if (free) block.problems[1].positions.clear();
    MergeInMemory runner(block.tiles.tree, block.problems, block.states);
    adjust(runner);
    ASSERT_EQ(runner.seams().size(), 1u);
    const SeamReport& seam = runner.seams().front();
    EXPECT_GT(seam.degrees, 20);
    for (const TileCheck& check : runner.tile_checks()) {
      EXPECT_EQ(check.degrees, seam.degrees) << "free " << free;
      EXPECT_NEAR(check.statistic, seam.statistic, 1e-6 * seam.statistic) << "free " << free;
    }
  }
}

// By hand, where a camera is all that a tile has in common with the rest, which knows R of it, or one direction only.
TEST(SeamCheck, ComparesATileThatSharesNoFrames) {
  const UnknownList camera = {{{UnknownKind::kCamera, 0, 3}, 2}};
  const Eigen::Matrix2d own{{4, 1}, {1, 3}};
  const Eigen::Vector2d score(1, -2);
  UpdateMatrix condensed{camera, 1, {4, 1, 3}, {score[0], score[1]}, {4, 3}, {}, {}};
  for (const Eigen::Matrix2d& rest : {Eigen::Matrix2d{{2, 0}, {0, 5}}, Eigen::Matrix2d{{2, 0}, {0, 0}}}) {
    const Eigen::Matrix2d covariance = (own + rest).inverse();
    const bool whole = rest(1, 1) > 0;
    const Eigen::Vector2d seen = whole ? score : Eigen::Vector2d(1, 0);  // a score that both sides can have
    condensed.rhs = {seen[0], seen[1]};
    const TileCheck check =
        check_tile(0, condensed, {camera, {covariance.data(), covariance.data() + 4}}, kSeamAlarmProbability);
    const double expected =
        seen.dot(own.inverse() * seen) + (whole ? seen.dot(rest.inverse() * seen) : seen[0] * seen[0] / rest(0, 0));
    EXPECT_EQ(check.degrees, whole ? 2 : 1);
    EXPECT_NEAR(check.statistic, expected, 1e-12);
    EXPECT_EQ(check.worst[0].id, camera[0].id);
  }
}

TEST(SeamCheck, NamesTheTileThatWasShifted) {
  TiledBlock block(simulate_block(clean_scene()), 12, without_loss(), 0.02);
  constexpr std::size_t kWrong = 2;
  // All positions that this tile observes are 1.5 m off.
  for (auto& term : block.problems[kWrong].positions) term.prior.position.x() += 1.5;
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  adjust(runner);
  int alarms = 0;
  for (const SeamReport& seam : runner.seams()) alarms += seam.alarm();
  EXPECT_GE(alarms, 1);
  const std::vector<std::string> lines = describe_seams(block.tiles.tree, runner.seams(), runner.tile_checks());
  ASSERT_FALSE(lines.empty());
  EXPECT_NE(lines.front().find("tile 2 "), std::string::npos) << lines.front();
}

// A clean block of 200 tiles: at 1e-3 for the whole block no seam may raise an alarm.
TEST(SeamCheck, IsSilentOnACleanBlockOf200Tiles) {
  SimulationOptions options = clean_scene();
  options.frames = 2400;
  options.seed = 21;
  const TiledBlock block(simulate_block(options), 12, without_loss(), 0.02);
  ASSERT_GE(block.tiles.tile_count, 200);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  adjust(runner);
  EXPECT_TRUE(describe_seams(block.tiles.tree, runner.seams(), runner.tile_checks()).empty());
  EXPECT_TRUE(describe_disagreements(runner.tile_checks()).empty());
}

// The same as a job adjusts it, with wrong matches: neither does a tile by itself.
TEST(SeamCheck, IsSilentWithLossesAndAnEstimatedSigma) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions options = clean_scene();
    options.frames = seed == 1 ? 2400 : 600;
    options.image_noise_px = 0.7;
    options.outlier_share = 0.01;
    options.calibrate = true;
    options.seed = seed;
    const TiledBlock block(simulate_block(options), 12, {}, 0.02);
    ASSERT_GE(block.tiles.tile_count, seed == 1 ? 200 : 50);
    const auto runner = adjusted_as_a_job(block, block.problems);
    const std::vector<TileCheck> checks = runner->tile_checks();
    EXPECT_TRUE(describe_seams(block.tiles.tree, runner->seams(), checks).empty()) << seed;
    EXPECT_TRUE(describe_disagreements(checks).empty()) << describe_disagreements(checks).front() << ", seed " << seed;
    // The chi-squares of the tiles scatter about that of the block as they should.
    double squares = 0, degrees = 0, scatter = 0;
    for (const TileCheck& check : checks) squares += check.own_chi2, degrees += static_cast<double>(check.own_degrees);
    for (const TileCheck& check : checks) {
      const auto own = static_cast<double>(check.own_degrees);
      scatter += std::pow(check.own_chi2 * degrees / squares - own, 2) / (2 * own);
    }
    const auto tiles = static_cast<double>(checks.size());
    EXPECT_NEAR(scatter, tiles, 5 * std::sqrt(2 * tiles)) << seed;
  }
}

TileCheck tile_with(std::int64_t tile, double own_chi2, std::int64_t own_degrees, double statistic = 0) {
  TileCheck check;
  check.tile = tile;
  check.own_chi2 = own_chi2;
  check.own_degrees = own_degrees;
  check.statistic = statistic;
  check.degrees = 50;
  check.threshold = 100;
  return check;
}

TEST(SeamCheck, ComparesTheNoiseOfATileWithThatOfTheOthers) {
  const auto noisy = [](const std::vector<TileCheck>& tiles) {
    std::vector<std::int64_t> named;
    for (const NoisyTile& tile : noisy_tiles(tiles)) named.push_back(tile.tile);
    return named;
  };
  using Tiles = std::vector<std::int64_t>;
  // Millions of degrees of freedom show the smallest difference; what photographs differ by means nothing.
  EXPECT_EQ(noisy({tile_with(0, 1.003e6, 1000000), tile_with(1, 0.96e6, 1000000), tile_with(2, 1.3e6, 1000000)}),
            Tiles());
  // Sigmas that are wrong as a whole are no tile's fault.
  EXPECT_EQ(noisy({tile_with(0, 900, 100), tile_with(1, 9000, 1000), tile_with(2, 9100, 1000)}), Tiles());
  // Neither is the worst one hidden by few degrees of freedom elsewhere, nor the second by the worst.
  EXPECT_EQ(noisy({tile_with(0, 1000, 1000), tile_with(1, 4000, 1000), tile_with(2, 1000, 1000),
                   tile_with(3, 50000, 1000), tile_with(4, 12, 2)}),
            (Tiles{3, 1}));
  // Of two one may be the worse; a single one has nothing to be compared with, nor have tiles without redundancy.
  EXPECT_EQ(noisy({tile_with(0, 1000, 1000), tile_with(1, 4000, 1000)}), Tiles{1});
  EXPECT_EQ(noisy({tile_with(0, 4000, 1000), tile_with(1, 3, 0), tile_with(2, 0, -2)}), Tiles());
  EXPECT_EQ(noisy({}), Tiles());
  // Residuals of rounding.
  EXPECT_EQ(noisy({tile_with(0, 1e-20, 1000), tile_with(1, 1e-12, 1000)}), Tiles());
}

// Tiles that are as much worse as is usual, of few degrees of freedom, against many and against few.
TEST(SeamCheck, NamesTilesForNoiseAsRarelyAsItSays) {
  std::mt19937_64 random(1);
  for (const std::int64_t others : {40, 4000}) {
    std::chi_squared_distribution<double> own(20), rest(static_cast<double>(others));
    int named = 0;
    constexpr int kTrials = 100000;
    for (int k = 0; k < kTrials; ++k)
      named += !noisy_tiles({tile_with(0, kUsualVarianceRatio * own(random), 20), tile_with(1, rest(random), others)})
                    .empty();
    const double expected = kTrials * kSeamAlarmProbability / 2;
    EXPECT_NEAR(named, expected, 5 * std::sqrt(expected)) << others;
  }
}

// Leaves 0 to 3, nodes 4 = 0 + 1, 5 = 2 + 3, 6 = 4 + 5.
MergeTree tree_of_four() {
  MergeTree tree;
  tree.nodes.resize(7);
  for (std::int64_t n = 0; n < 4; ++n) tree.nodes[n].tile = TileIndex(n), tree.nodes[n].parent = 4 + n / 2;
  tree.nodes[4].left = 0, tree.nodes[4].right = 1, tree.nodes[5].left = 2, tree.nodes[5].right = 3;
  tree.nodes[6].left = 4, tree.nodes[6].right = 5;
  tree.nodes[4].parent = tree.nodes[5].parent = 6;
  return tree;
}

// The tile that the line of each seam names; -1: no line.
std::vector<std::int64_t> explained(const std::vector<std::int64_t>& alarms, const std::vector<TileCheck>& tiles) {
  std::vector<SeamReport> seams;
  for (const std::int64_t node : {4, 5, 6})
    seams.push_back({node, std::ranges::find(alarms, node) != alarms.end() ? 200.0 : 50.0, 50, 100});
  std::vector<std::int64_t> named(3, -1);
  for (const std::string& line : describe_seams(tree_of_four(), seams, tiles)) {
    long long node = 0, tile = -1;
    std::sscanf(line.c_str(), "seam at node %lld", &node);
    std::sscanf(line.substr(line.find("; tile")).c_str(), "; tile %lld", &tile);
    named[static_cast<std::size_t>(node - 4)] = tile;
  }
  return named;
}

TEST(SeamCheck, NamesTheTileUnderTheSeamWhoseRemovalClearsMostAlarms) {
  const auto tile = [](std::int64_t number, double statistic, double noise = 1) {
    return tile_with(number, 1000 * noise, 1000, statistic);
  };
  using Named = std::vector<std::int64_t>;
  EXPECT_EQ(explained({}, {tile(0, 150), tile(1, 90), tile(2, 300), tile(3, 80)}), (Named{-1, -1, -1}));
  // Tile 2 is farthest from the rest, but not under the seam.
  EXPECT_EQ(explained({4}, {tile(0, 150), tile(1, 90), tile(2, 300), tile(3, 80)}), (Named{0, -1, -1}));
  // One of 2 and 3 explains both alarms, 0 only one.
  EXPECT_EQ(explained({5, 6}, {tile(0, 400), tile(1, 90), tile(2, 130), tile(3, 120)}), (Named{-1, 2, 2}));
  // When what the first explains is left out, the other alarm has a tile of its own.
  EXPECT_EQ(explained({4, 5, 6}, {tile(0, 110), tile(1, 160), tile(2, 130), tile(3, 120)}), (Named{1, 2, 1}));
  // A tile that disagrees with itself comes first.
  EXPECT_EQ(explained({4, 5, 6}, {tile(0, 110, 4), tile(1, 160), tile(2, 130), tile(3, 120)}), (Named{0, 2, 0}));
}

// A rig that looks all around. 10^-4 rad are 0.14 px; with 300 measurements of 0.5 px on either side that is less than
// what any test that is silent on 200 clean tiles can tell from chance (docs/results/whole-blocks.md). The same with
// 0.25 px, or with 1 200 measurements, can be told.
SimulationOptions dense_street() {
  SimulationOptions options = clean_scene();
  options.scene = SimulationOptions::Scene::kStreet;
  options.rig_cameras = 4;
  options.frames = 60;
  options.points_per_frame = 850;
  options.image_noise_px = 0.25;
  return options;
}

// Frames that other tiles have as well.
std::vector<std::uint8_t> shared_frames(const TiledBlock& block, std::size_t tile) {
  std::vector<std::uint8_t> shared;
  for (const FrameIndex frame : block.problems[tile].frames) {
    const auto has = [&](const TileProblem& problem) { return std::ranges::binary_search(problem.frames, frame); };
    shared.push_back(std::ranges::count_if(block.problems, has) > 1);
  }
  return shared;
}

// Doubles the noise of the points that no frame of another tile sees, which say little to a seam; the share of the
// observations that these have.
double double_noise_inside(const TiledBlock& block, std::size_t tile, double noise_px, TileProblem& problem) {
  const std::vector<std::uint8_t> shared = shared_frames(block, tile);
  std::mt19937_64 random(tile + 1);
  std::normal_distribution<double> noise(0, std::sqrt(3) * noise_px);
  std::int64_t inside = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    const auto first = problem.image.begin() + problem.begin[p], end = problem.image.begin() + problem.begin[p + 1];
    if (std::any_of(first, end, [&](LocalImage i) { return shared[problem.images[i.value].frame.value]; })) continue;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row, ++inside)
      problem.x[row] += noise(random), problem.y[row] += noise(random);
  }
  return static_cast<double>(inside) / static_cast<double>(problem.observation_count());
}

TEST(SeamCheck, NamesOneTileOfTenWithDoubledNoiseThoughItsSeamsAgree) {
  SimulationOptions options = dense_street();
  options.frames = 900;
  options.points_per_frame = 60;
  const TiledBlock block(simulate_block(options), 100, {}, 0.02);
  ASSERT_GE(block.tiles.tile_count, 10);
  int tried = 0;
  for (std::size_t wrong = 0; wrong < block.problems.size(); ++wrong) {
    std::vector<TileProblem> problems = block.problems;
    if (double_noise_inside(block, wrong, options.image_noise_px, problems[wrong]) < 0.5) continue;
    ++tried;
    const auto runner = adjusted_as_a_job(block, problems);
    const std::vector<TileCheck> checks = runner->tile_checks();
    EXPECT_TRUE(describe_seams(block.tiles.tree, runner->seams(), checks).empty()) << "tile " << wrong;
    const std::vector<NoisyTile> noisy = noisy_tiles(checks);
    ASSERT_EQ(noisy.size(), 1u) << "tile " << wrong;
    EXPECT_EQ(noisy[0].tile, static_cast<std::int64_t>(wrong));
    EXPECT_GT(std::sqrt(noisy[0].ratio), 1.4);
    EXPECT_LT(std::sqrt(noisy[0].ratio), 2.1);
    const std::vector<std::string> lines = describe_disagreements(checks);
    EXPECT_EQ(lines[0].find("tile " + std::to_string(wrong) + " disagrees with itself"), 0u) << lines[0];
  }
  EXPECT_GE(tried, 5);
}

// The first line names the tile that is wrong, alone or with another one; whether alone.
bool expect_tile_named(const TiledBlock& block, const std::vector<TileProblem>& problems, std::size_t wrong,
                       const std::vector<TileState>& states) {
  MergeInMemory runner(block.tiles.tree, problems, states);
  adjust(runner);
  const std::vector<std::string> lines = describe_disagreements(runner.tile_checks());
  EXPECT_FALSE(lines.empty()) << "nothing is said of tile " << wrong;
  if (lines.empty()) return false;
  const std::string number = std::to_string(wrong);
  const bool alone = lines.front().find("tile " + number + " ") == 0;
  EXPECT_TRUE(alone || lines.front().find("tiles " + number + " ") == 0 ||
              lines.front().find("and " + number + " ") != std::string::npos)
      << lines.front();
  return alone;
}

TEST(SeamCheck, NamesTheTileWhoseMeasurementsOfTwoFramesAreTurned) {
  TiledBlock block(simulate_block(dense_street()), 15, without_loss(), 0.02);
  ASSERT_GE(block.tiles.tile_count, 4);
  for (TileProblem& problem : block.problems) set_image_sigma(problem, dense_street().image_noise_px);
  int alone = 0;
  for (std::size_t wrong = 0; wrong < block.problems.size(); ++wrong) {
    const SharedFrames shared = most_shared_frames(block, wrong);
    ASSERT_GE(shared.observations, 300);
    std::vector<TileProblem> problems = block.problems;
    for (const FrameIndex frame : shared.frames) turn_frame(block, frame, Eigen::Vector3d(0, 1e-4, 0), problems[wrong]);
    alone += expect_tile_named(block, problems, wrong, block.states);
  }
  EXPECT_GE(alone, 2);  // where the frames are not shared by two tiles alone
}

TileCheck tile_that_sees(std::int64_t tile, const UnknownCheck& check) {
  TileCheck result;
  result.tile = tile;
  result.worst[0] = check;
  return result;
}

UnknownCheck turn_of(std::int64_t frame, std::int64_t other, double statistic) {
  UnknownCheck check;
  check.id = {UnknownKind::kFrame, 0, frame};
  check.other.index = other;
  check.turn = true;
  check.statistic = statistic;
  check.degrees = other < 0 ? 3 : 6;
  check.threshold = other < 0 ? 30 : 45;
  return check;
}

TEST(SeamCheck, NamesATileAloneWhereTheOthersExplainMuchLess) {
  const TileCheck worst = tile_that_sees(3, turn_of(7, 8, 90)), much_less = tile_that_sees(1, turn_of(7, -1, 50)),
                  as_well = tile_that_sees(5, turn_of(8, 9, 85)), of_another = tile_that_sees(6, turn_of(20, -1, 40));
  std::vector<std::string> lines = describe_disagreements({much_less, worst, of_another});
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].find("tile 3 sees the turn of frame 7 and frame 8 differently"), 0u) << lines[0];
  EXPECT_EQ(lines[1].find("tile 6 sees the turn of frame 20 differently"), 0u) << lines[1];
  lines = describe_disagreements({much_less, worst, as_well});
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].find("tiles 3 and 5 see the turn of frame 7 and frame 8 differently, one of them wrongly"), 0u)
      << lines[0];
}

TEST(SeamCheck, NamesTheTileWhoseFocalLengthIsHeldWrong) {
  SimulationOptions options = dense_street();
  options.points_per_frame = 300;
  options.image_noise_px = 0.5;
  const TiledBlock block(simulate_block(options), 15, without_loss(), 0.02);
  for (std::size_t wrong = 0; wrong < block.problems.size(); ++wrong) {
    std::vector<TileState> states = block.states;
    states[wrong].cameras[0][kFocal] *= 1.005;
    expect_tile_named(block, block.problems, wrong, states);
  }
}

}  // namespace
}  // namespace megablock
