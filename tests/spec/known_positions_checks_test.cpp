// Acceptance tests of "Bundle adjustment with known positions" (A. Barrier, S. Martin): tiles against one problem, and
// checks of a result without known truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "adjust/checks/sanity_checks.h"
#include "adjust/checks/subset_check.h"
#include "io/base/error.h"
#include "io/simulate/streets/street_scene.h"
#include "known_positions_scene.h"
#include "merge/checks/seam_text.h"
#include "merge/tree/tile_solver.h"
#include "reached.h"
#include "tests/support/adjust/single_tile.h"
#include "tests/support/merge/turned_frames.h"

namespace megablock {
namespace {

// Ten cameras of which point j is seen by six in a row, from camera first[j % groups] on.
KnownPositionsOptions ten_cameras(KnownPositionsOptions options) {
  options.cameras = 10;
  return options;
}
SimulatedBlock seen_in_part(const KnownPositionsScene& scene, const std::vector<std::int64_t>& first) {
  SimulatedBlock block = scene.block();
  const TrackSet all = std::exchange(block.tracks, TrackSet{});
  block.tracks.begin.push_back(0);
  for (std::size_t j = 0; j < all.id.size(); ++j) {
    const std::int64_t from = first[j % first.size()];
    block.tracks.id.push_back(all.id[j]);
    for (auto o = static_cast<std::size_t>(all.begin[j]); o < static_cast<std::size_t>(all.begin[j + 1]); ++o) {
      if (all.image[o].value < from || all.image[o].value >= from + 6) continue;
      block.tracks.image.push_back(all.image[o]);
      block.tracks.x.push_back(all.x[o]);
      block.tracks.y.push_back(all.y[o]);
      block.tracks.feature.push_back(-1);
    }
    block.tracks.begin.push_back(block.tracks.observation_count());
  }
  return block;
}

void adjust_exactly(MergeInMemory& runner) {
  GlobalOptions exact;
  exact.max_decrement = 1e-9;
  GlobalState state = start_global(exact);
  adjust_globally(runner, exact, state);
  EXPECT_TRUE(state.outcome == GlobalOutcome::kConverged || state.outcome == GlobalOutcome::kRoundingFloor)
      << describe(state);
}

double largest_angle(const std::vector<Pose>& a, const std::vector<Pose>& b) {
  double angle = 0;
  for (std::size_t f = 0; f < b.size(); ++f)
    keep_largest(angle, rotation_log<double>(a[f].rotation.conjugate() * b[f].rotation).norm());
  return angle;
}

TEST(KnownPositions, TKP16TilesGiveTheSameAsOneProblem) {
  for (const bool drone : {false, true}) {
    const KnownPositionsScene scene(
        ten_cameras(drone ? KnownPositionsOptions::drone(300, 5) : KnownPositionsOptions::satellite(300, 0.1, 5)));
    SimulatedBlock block = seen_in_part(scene, {0, 2, 4});
    SingleTile lone(block, adjustment_of(scene));
    triangulate_points(lone.problem, lone.state, lone.options);
    block.truth = initial_state(block.block);  // where the tiles start
    block.points = lone.state.points;
    const TiledBlock tiled(block, 4, lone.options.observations, 0);
    ASSERT_GE(tiled.tiles.tile_count, 3);
    MergeInMemory several(tiled.tiles.tree, tiled.problems, tiled.states);
    adjust_exactly(several);
    MergeTree one;
    one.nodes.push_back({-1, -1, -1, TileIndex(0), 0});
    MergeInMemory serial(one, {tiled.whole}, {tiled.whole_state});
    adjust_exactly(serial);
    const TileState together = tiled.gathered(several.problems(), several.states()), &whole = serial.states()[0];
    const std::string what = drone ? "drone, " : "satellite, ";
    expect_at_most(largest_angle(together.frames, whole.frames), 1e-10,
                   what + "attitudes of the tiles off one problem's, rad");
    double moved = 0;
    for (std::size_t f = 0; f < whole.frames.size(); ++f)
      keep_largest(moved, (whole.frames[f].centre - scene.centres[f]).norm());
    expect_at_most(moved, 1e-9, what + "held positions moved by, m");

    // The verdict is a sum over tiles.
    const MotionReference reference = motion_references(block.block, tiled.tiles).at(0);
    CommonMotion sum;
    for (std::size_t t = 0; t < several.problems().size(); ++t)
      sum.add(
          CommonMotion::from_values(common_motion(several.problems()[t], several.states()[t], reference).to_values()));
    const MotionVerdict of_tiles = judge(sum, reference),
                        of_whole = judge(common_motion(tiled.whole, whole, reference), reference);
    EXPECT_EQ(of_tiles.weak, of_whole.weak);
    EXPECT_EQ(of_tiles.weak > 0, !drone);
    if (of_whole.weak > 0) {  // frames that tiles share answer in each by themselves: to the careful side
      const double ratio = of_tiles.common_sigma_rad / of_whole.common_sigma_rad;
      expect_at_least(ratio, 0.9, what + "common sigma of the tiles over that of one problem");
      expect_at_most(ratio, 2, what + "common sigma of the tiles over that of one problem");
    }
  }
}

// A tile as the only one of its block, from the points' first intersection to the pass that covariances follow from;
// null where it cannot be solved.
std::unique_ptr<MergeInMemory> adjusted_alone(SingleTile& tile) {
  triangulate_points(tile.problem, tile.state, tile.options);
  if (!solve_by_condensation(tile.problem, tile.state, {}).usable) return nullptr;
  auto runner =
      std::make_unique<MergeInMemory>(single_tile(tile.simulated.block).tree, std::vector<TileProblem>{tile.problem},
                                      std::vector<TileState>{tile.state});
  adjust_exactly(*runner);
  runner->final_up();
  return runner;
}

// Without attitude priors there is nothing for common_motion to weigh. The rotation about the line of the positions is
// then free, and the datum says so; a common rotation of satellites is as good as their images tell, which is less than
// the priors would (the report's adjustment without them: angles 8 times worse), and the attitudes' sigmas say so.
TEST(KnownPositions, TKP20WithoutAttitudesDatumAndSigmasTell) {
  for (const bool drone : {true, false})
    for (const bool collinear : {true, false}) {
      const std::string what =
          std::string(drone ? "drone" : "satellite") + (collinear ? ", collinear: " : ", spread: ");
      constexpr int kRuns = 20;
      double squares = 0, least_sigma = 1e9;
      int free = 0, judged = 0;
      for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
        KnownPositionsOptions options =
            drone ? KnownPositionsOptions::drone(100, seed) : KnownPositionsOptions::satellite(100, 0.1, seed);
        options.collinear = collinear;
        const KnownPositionsScene scene(options);
        SimulatedBlock block = scene.block();
        for (std::size_t f = 0; f < scene.centres.size(); ++f) {
          Frame& frame = block.block.frames[FrameIndex(static_cast<std::int64_t>(f))];
          frame.attitude_prior.reset();
          frame.given_pose->rotation = rotation_from(scene.true_angles[f]);  // where it starts is no matter here
        }
        SingleTile tile(std::move(block), adjustment_of(scene));
        const MotionReference reference =
            motion_references(tile.simulated.block, single_tile(tile.simulated.block)).at(0);
        judged += !judge(common_motion(tile.problem, tile.state, reference), reference).sound();
        const std::unique_ptr<MergeInMemory> runner = adjusted_alone(tile);
        ASSERT_TRUE(runner);
        free += runner->gauge().defect == 1;
        if (collinear) continue;
        const TileState& state = runner->states()[0];
        const Eigen::Matrix3d covariance = runner->covariances().at(0).frames[0].topLeftCorner<3, 3>();
        const Eigen::Vector3d error =
            rotation_log<double>(rotation_from(scene.true_angles[0]).conjugate() * state.frames[0].rotation);
        squares += error.dot(covariance.inverse() * error) / (3 * kRuns);
        keep_smallest(least_sigma, std::sqrt(covariance.trace() / 3));
      }
      expect_within(free, collinear ? kRuns : 0, 0, what + "scenes of 20 whose datum has a free direction");
      expect_at_most(judged, 0, what + "scenes judged by attitudes that there are not");
      if (collinear) continue;
      expect_within(squares, 1, 0.6, what + "mean squared error of an attitude over its sigma");
      if (!drone) expect_at_least(least_sigma, 2 * 1e-5, what + "least sigma of an attitude, rad");
    }
}

TEST(KnownPositions, TKP14PointSubsetsAgreeAndSayWhatTheyShare) {
  for (const bool drone : {true, false}) {
    KnownPositionsOptions options =
        drone ? KnownPositionsOptions::drone(1001, 14) : KnownPositionsOptions::satellite(1001, 0.1, 14);
    options.image_sigma_px = 0.1;
    const KnownPositionsScene scene(options);
    SingleTile tile(scene.block(), adjustment_of(scene));
    triangulate_points(tile.problem, tile.state, tile.options);
    ASSERT_TRUE(solve_by_condensation(tile.problem, tile.state, {}).usable);
    const MotionReference reference = motion_references(tile.simulated.block, single_tile(tile.simulated.block)).at(0);
    const SubsetCheck check = check_point_subsets(tile.problem, tile.state, 0, 5, reference, solve_by_condensation);
    double squares = 0;
    for (std::size_t f = 0; f < scene.centres.size(); ++f)
      squares += rotation_log<double>(rotation_from(scene.true_angles[f]).conjugate() * tile.state.frames[f].rotation)
                     .squaredNorm();
    const double error = std::sqrt(squares / (3 * static_cast<double>(scene.centres.size())));
    const std::string what = drone ? "drone, " : "satellite, ";
    std::printf("[ reached  ] %strue error %.3g rad per axis, stated sigma %.3g\n", what.c_str(), error,
                check.rotation_sigma_rad());
    if (drone) {
      expect_at_most(check.rotation_spread_rad, 1e-5, what + "spread of the attitudes, rad");
      expect_at_most(check.image_spread_px, 0.02, what + "spread of the reference point, px");
      EXPECT_EQ(check.common_sigma_rad, 0);
    } else {
      expect_at_most(check.rotation_spread_rad, 1e-6, what + "spread of the attitudes, rad");
      expect_at_least(check.common_sigma_rad, 0.8 * 1e-5 / std::sqrt(6), what + "sigma of what subsets share, rad");
      expect_at_most(check.common_sigma_rad, 1.2 * 1e-5 / std::sqrt(6), what + "sigma of what subsets share, rad");
    }
    expect_at_most(error, 3 * check.rotation_sigma_rad(), what + "true error of the attitudes, rad");
  }
}

TEST(KnownPositions, PointSubsetsThatMakeNoCheckAreRefused) {
  const KnownPositionsScene scene(KnownPositionsOptions::satellite(60, 0.1, 14));
  SingleTile tile(scene.block(), adjustment_of(scene));
  triangulate_points(tile.problem, tile.state, tile.options);
  const MotionReference motion = motion_references(tile.simulated.block, single_tile(tile.simulated.block)).at(0);
  const auto check = [&](std::int64_t reference, int subsets) {
    return check_point_subsets(tile.problem, tile.state, reference, subsets, motion, solve_by_condensation);
  };
  EXPECT_EQ(check(0, 2).subsets, 2);
  for (const int subsets : {1, 0, -1}) EXPECT_THROW(check(0, subsets), InputError) << subsets;
  for (const std::int64_t reference : {std::int64_t{-1}, tile.problem.point_count()})
    EXPECT_THROW(check(reference, 2), InputError) << reference;
  const auto first = tile.problem.kept.begin() + tile.problem.begin[0];
  std::fill(first, tile.problem.kept.begin() + tile.problem.begin[1], 0);
  EXPECT_THROW(check(0, 2), InputError) << "a point that nothing measures any more";
}

// Over many scenes the mean squared error is the mean of the stated squared sigmas. Three rotations in common for the
// satellites, hence 150 deviates in 50 scenes: 1 +- 0.12.
TEST(KnownPositions, TKP14StatedSigmasAreTrueOverManyScenes) {
  for (const bool drone : {true, false}) {
    double squared_error = 0, squared_sigma = 0;
    for (std::uint64_t seed = 1; seed <= 50; ++seed) {
      KnownPositionsOptions options =
          drone ? KnownPositionsOptions::drone(301, seed) : KnownPositionsOptions::satellite(301, 0.1, seed);
      options.image_sigma_px = 0.1;
      const KnownPositionsScene scene(options);
      SingleTile tile(scene.block(), adjustment_of(scene));
      triangulate_points(tile.problem, tile.state, tile.options);
      ASSERT_TRUE(solve_by_condensation(tile.problem, tile.state, {}).usable);
      const MotionReference reference =
          motion_references(tile.simulated.block, single_tile(tile.simulated.block)).at(0);
      const SubsetCheck check = check_point_subsets(tile.problem, tile.state, 0, 5, reference, solve_by_condensation);
      for (std::size_t f = 0; f < scene.centres.size(); ++f)
        squared_error +=
            rotation_log<double>(rotation_from(scene.true_angles[f]).conjugate() * tile.state.frames[f].rotation)
                .squaredNorm() /
            (3 * static_cast<double>(scene.centres.size()));
      squared_sigma += std::pow(check.rotation_sigma_rad(), 2);
    }
    const double ratio = squared_error / squared_sigma;
    const std::string what = drone ? "drone, " : "satellite, ";
    expect_at_most(ratio, 1.3, what + "mean squared error over the stated one");
    expect_at_least(ratio, 0.7, what + "mean squared error over the stated one");
  }
}

// Two tiles that share cameras 4 and 5.
struct TwoTiles {
  KnownPositionsScene scene;
  SimulatedBlock block;
  explicit TwoTiles(std::uint64_t seed)
      : scene([&] {
          KnownPositionsOptions options = ten_cameras(KnownPositionsOptions::drone(400, seed));
          options.image_sigma_px = 0.1;
          return options;
        }()),
        block(seen_in_part(scene, {0, 4})) {}
};

TEST(KnownPositions, TKP15TilesAgreeAboutTheCamerasTheyShare) {
  const TwoTiles two(15);
  std::array<TileState, 2> states;
  std::array<TileCovariance, 2> covariances;
  for (std::size_t t = 0; t < 2; ++t) {
    SingleTile tile(two.block, adjustment_of(two.scene));
    for (std::size_t p = 0; p < tile.problem.points.size(); ++p)
      if (p % 2 != t)
        std::fill(tile.problem.kept.begin() + tile.problem.begin[p],
                  tile.problem.kept.begin() + tile.problem.begin[p + 1], 0);
    const std::unique_ptr<MergeInMemory> runner = adjusted_alone(tile);
    ASSERT_TRUE(runner);
    covariances[t] = runner->covariances().at(0);
    states[t] = runner->states()[0];
  }
  double worst = 0;
  for (const std::size_t camera : {4u, 5u}) {
    const Eigen::Vector3d difference =
        rotation_log<double>(states[0].frames[camera].rotation.conjugate() * states[1].frames[camera].rotation);
    for (int k = 0; k < 3; ++k)
      keep_largest(worst, std::abs(difference[k]) /
                              std::sqrt(covariances[0].frames[camera](k, k) + covariances[1].frames[camera](k, k)));
  }
  expect_at_most(worst, 3, "difference of the shared cameras over its sigma");
}

TEST(KnownPositions, TKP15CorruptedTileIsNamed) {
  const TwoTiles two(16);
  SingleTile lone(two.block, adjustment_of(two.scene));
  TiledBlock tiled(two.block, 5, lone.options.observations, 0);
  ASSERT_GE(tiled.tiles.tile_count, 2);
  const auto checked = [&] {
    MergeInMemory runner(tiled.tiles.tree, tiled.problems, tiled.states);
    adjust_exactly(runner);
    runner.final_up();
    const bool alarm =
        std::any_of(runner.seams().begin(), runner.seams().end(), [](const SeamReport& seam) { return seam.alarm(); });
    return std::pair{alarm, describe_disagreements(runner.tile_checks())};
  };
  const auto sound = checked();
  EXPECT_FALSE(sound.first);
  EXPECT_THAT(sound.second, testing::IsEmpty());
  std::size_t wrong = 0;
  for (std::size_t t = 1; t < tiled.problems.size(); ++t)
    if (most_shared_frames(tiled, t).observations > most_shared_frames(tiled, wrong).observations) wrong = t;
  const SharedFrames shared = most_shared_frames(tiled, wrong);
  ASSERT_GT(shared.observations, 50);
  for (const FrameIndex frame : shared.frames) turn_frame(tiled, frame, {0, 1e-4, 0}, tiled.problems[wrong]);
  const auto corrupted = checked();
  EXPECT_TRUE(corrupted.first);
  EXPECT_THAT(corrupted.second, testing::Not(testing::IsEmpty()));
  for (const std::string& line : corrupted.second) std::printf("[ reached  ] %s\n", line.c_str());
  // What is worst names the tile, with the other one that sees these cameras, and both of them.
  ASSERT_EQ(shared.frames.size(), 2u);
  const std::string& worst = corrupted.second.at(0);
  EXPECT_THAT(worst, testing::ContainsRegex("^tiles? ([0-9]+ and )*" + std::to_string(wrong) + " "));
  for (const FrameIndex frame : shared.frames)
    EXPECT_THAT(worst, testing::ContainsRegex("frame " + std::to_string(frame.value) + "( |$)"));
}

TEST(KnownPositions, TKP17StripsAreStraightAndEven) {
  std::vector<Eigen::Vector3d> strip;
  for (int i = 0; i < 3; ++i)
    strip.push_back(Eigen::Vector3d(700e3, 20e3, 694e3) + i * Eigen::Vector3d(30e3, -52e3, 4e3));
  EXPECT_TRUE(check_strip(strip).sound());
  const double spacing = (strip[1] - strip[0]).norm();
  const Eigen::Vector3d along = (strip[1] - strip[0]).normalized(), across = along.unitOrthogonal();
  for (const double share : {0.04, 0.08}) {
    std::vector<Eigen::Vector3d> uneven = strip, bent = strip;
    uneven[1] += share * spacing * along;
    bent[1] += 1.5 * share * spacing * across;  // a third of it is taken by the line itself
    const bool good = share < 0.05;
    const auto expect = good ? expect_at_most : expect_at_least;
    expect(check_strip(uneven).uneven, 0.05, "distances that differ, of the spacing");
    expect(check_strip(bent).off_line, 0.05, "off the line, of the spacing");
    EXPECT_EQ(check_strip(uneven).sound(), good);
    EXPECT_EQ(check_strip(bent).sound(), good);
  }
  EXPECT_TRUE(check_strip({strip[0], strip[2]}).sound());
  EXPECT_FALSE(check_strip({strip[0], strip[0], strip[0]}).sound());
}

TEST(KnownPositions, TKP17FlatSceneOnTwoLevelsIsFlagged) {
  std::mt19937_64 random(17);
  std::uniform_real_distribution<double> place(-500, 500);
  std::normal_distribution<double> noise(0, 0.3);
  int flat_flagged = 0, steps_flagged = 0;
  double step_error = 0;
  for (const double share : {0.0, 0.2, 0.5})
    for (int run = 0; run < 20; ++run) {
      std::vector<Eigen::Vector3d> points;
      for (int i = 0; i < 400; ++i) {
        const double x = place(random), y = place(random), step = x < -500 + 1000 * share ? 5 : 0;
        points.emplace_back(x, y, 0.02 * x - 0.01 * y + step + noise(random));
      }
      const LevelCheck check = check_one_level(points);
      EXPECT_EQ(check.sound(), share == 0) << share << ": " << check.separation;
      (share == 0 ? flat_flagged : steps_flagged) += !check.sound();
      if (share > 0) keep_largest(step_error, std::abs(check.step - 5));
    }
  expect_at_most(flat_flagged, 0, "flat scenes flagged, of 20");
  expect_at_least(steps_flagged, 40, "scenes with a step of 5 m flagged, of 40");
  expect_at_most(step_error, 0.5, "height of a step off by, m");
}

}  // namespace
}  // namespace megablock
