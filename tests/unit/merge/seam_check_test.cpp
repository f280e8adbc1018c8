#include "merge/seam_check.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "geometry/camera.h"
#include "geometry/rotation.h"
#include "tests/unit/merge/tiled_block.h"

namespace megablock {
namespace {

SimulationOptions scene() {
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

void adjust(SerialRunner& runner) {
  GlobalOptions options;
  options.max_decrement = 1e-4;
  GlobalState state = start_global(options);
  adjust_globally(runner, options, state);
  ASSERT_EQ(state.outcome, GlobalOutcome::kConverged);
  runner.final_up();
}

// Over all seams and several blocks the sum of T is chi-square distributed with the sum of the degrees.
TEST(SeamCheck, HasItsChiSquareMeanOnCleanData) {
  double statistic = 0, degrees = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SimulationOptions options = scene();
    options.seed = seed;
    const TiledBlock block(simulate_block(options), 12, without_loss(), 0.02);
    SerialRunner runner(block.tiles.tree, block.problems, block.states);
    adjust(runner);
    ASSERT_GE(runner.seams().size(), 4u);
    for (const SeamReport& seam : runner.seams()) {
      EXPECT_FALSE(seam.alarm()) << "T " << seam.statistic << " of " << seam.degrees;
      statistic += seam.statistic;
      degrees += static_cast<double>(seam.degrees);
    }
    EXPECT_TRUE(describe_seams(runner.seams(), runner.tile_checks()).empty());
    EXPECT_TRUE(describe_disagreements(runner.tile_checks()).empty());
  }
  EXPECT_GT(degrees, 500);
  EXPECT_NEAR(statistic, degrees, 5 * std::sqrt(2 * degrees));
}

TEST(SeamCheck, NamesTheTileThatWasShifted) {
  TiledBlock block(simulate_block(scene()), 12, without_loss(), 0.02);
  constexpr std::size_t kWrong = 2;
  // All positions that this tile observes are 1.5 m off.
  for (auto& term : block.problems[kWrong].positions) term.prior.position.x() += 1.5;
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  adjust(runner);
  int alarms = 0;
  for (const SeamReport& seam : runner.seams()) alarms += seam.alarm();
  EXPECT_GE(alarms, 1);
  const std::vector<std::string> lines = describe_seams(runner.seams(), runner.tile_checks());
  ASSERT_FALSE(lines.empty());
  EXPECT_NE(lines.front().find("tile 2 "), std::string::npos) << lines.front();
}

// A clean block of 200 tiles: at 1e-3 for the whole block no seam may raise an alarm.
TEST(SeamCheck, IsSilentOnACleanBlockOf200Tiles) {
  SimulationOptions options = scene();
  options.frames = 2400;
  options.seed = 21;
  const TiledBlock block(simulate_block(options), 12, without_loss(), 0.02);
  ASSERT_GE(block.tiles.tile_count, 200);
  SerialRunner runner(block.tiles.tree, block.problems, block.states);
  adjust(runner);
  EXPECT_TRUE(describe_seams(runner.seams(), runner.tile_checks()).empty());
  EXPECT_TRUE(describe_disagreements(runner.tile_checks()).empty());
}

// A rig that looks all around, with many measurements of each frame: 0.14 px in 300 measurements of 0.5 px on either
// side would be less than 3 sigma of the difference, and no test that is silent on 200 clean tiles can tell that from
// chance.
SimulationOptions dense_street() {
  SimulationOptions options = scene();
  options.scene = SimulationOptions::Scene::kStreet;
  options.rig_cameras = 4;
  options.frames = 60;
  options.points_per_frame = 5000;
  return options;
}

// Observations of a frame in a tile.
std::int64_t observations_of(const TileProblem& problem, FrameIndex frame) {
  return std::count_if(problem.image.begin(), problem.image.end(), [&](LocalImage image) {
    return problem.frames[problem.images[image.value].frame.value] == frame;
  });
}

// Moves the measurements that `problem` holds of a frame to where they were, had it been turned.
void turn_frame(const TiledBlock& block, FrameIndex frame, const Eigen::Vector3d& turn, TileProblem& problem) {
  const BlockState& truth = block.simulated.truth;
  Pose turned = truth.frames[frame];
  turned.rotation = rotation_update(turned.rotation, turn);
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    for (std::int64_t o = problem.begin[p]; o < problem.begin[p + 1]; ++o) {
      const TileImage& image = problem.images[problem.image[o].value];
      if (problem.frames[image.frame.value] != frame || problem.points[p].role != PointRole::kTie) continue;
      const Eigen::Vector3d& ground = block.simulated.points[problem.points[p].index];
      const Intrinsics& camera = truth.cameras[problem.cameras[image.camera.value]];
      const Pose& mount = truth.mounts[problem.mounts[image.mount].rig][problem.mounts[image.mount].mount];
      const Eigen::Vector2d before = project(camera, to_camera(truth.frames[frame], mount, ground)),
                            after = project(camera, to_camera(turned, mount, ground));
      problem.x[o] += after.x() - before.x();
      problem.y[o] += after.y() - before.y();
    }
}

// The first line names the tile that is wrong.
void expect_named(const TiledBlock& block, const std::vector<TileProblem>& problems, std::size_t wrong,
                  const std::vector<TileState>& states) {
  SerialRunner runner(block.tiles.tree, problems, states);
  adjust(runner);
  const std::vector<std::string> lines = describe_disagreements(runner.tile_checks());
  ASSERT_FALSE(lines.empty()) << "nothing is said of tile " << wrong;
  const std::string number = std::to_string(wrong);
  EXPECT_TRUE(lines.front().find("tile " + number + " ") != std::string::npos ||
              lines.front().find("tiles " + number + " ") != std::string::npos ||
              lines.front().find("and " + number + " ") != std::string::npos)
      << lines.front();
}

TEST(SeamCheck, NamesTheTileWhoseMeasurementsOfTwoFramesAreTurned) {
  const TiledBlock block(simulate_block(dense_street()), 15, without_loss(), 0.02);
  ASSERT_GE(block.tiles.tile_count, 4);
  for (std::size_t wrong = 0; wrong < block.problems.size(); ++wrong) {
    // Its frames by the observations on the side that has fewer.
    std::vector<std::pair<std::int64_t, FrameIndex>> boundary;
    for (const FrameIndex frame : block.problems[wrong].frames) {
      std::int64_t elsewhere = 0;
      for (std::size_t t = 0; t < block.problems.size(); ++t)
        if (t != wrong) elsewhere = std::max(elsewhere, observations_of(block.problems[t], frame));
      boundary.emplace_back(std::min(observations_of(block.problems[wrong], frame), elsewhere), frame);
    }
    std::sort(boundary.rbegin(), boundary.rend());
    ASSERT_GE(boundary[1].first, 1500);
    std::vector<TileProblem> problems = block.problems;
    for (std::size_t i = 0; i < 2; ++i)
      turn_frame(block, boundary[i].second, Eigen::Vector3d(0, 1e-4, 0), problems[wrong]);
    expect_named(block, problems, wrong, block.states);
  }
}

TEST(SeamCheck, NamesTheTileWhoseFocalLengthIsHeldWrong) {
  SimulationOptions options = dense_street();
  options.points_per_frame = 300;
  const TiledBlock block(simulate_block(options), 15, without_loss(), 0.02);
  for (std::size_t wrong = 0; wrong < block.problems.size(); ++wrong) {
    std::vector<TileState> states = block.states;
    states[wrong].cameras[0][kFocal] *= 1.005;
    expect_named(block, block.problems, wrong, states);
  }
}

}  // namespace
}  // namespace megablock
