// One step of the block-wise compensation equals one solution of the full damped normal equations.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "merge/checks/monolithic.h"
#include "tests/support/adjust/known_lines.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

struct StepCase {
  const char* name;
  SimulationOptions simulation;
  ObservationOptions observations;
  bool free_mounts = false;
  bool lines = false;
  bool verticals = false;
  bool camera_by_camera = false;  // the order of a track's observations
  bool distances = false;
};

SimulationOptions aerial_steps() {
  SimulationOptions o;
  o.frames = 90;
  o.points_per_frame = 60;
  return o;
}

SimulationOptions street_steps() {
  SimulationOptions o = aerial_steps();
  o.scene = SimulationOptions::Scene::kStreet;
  o.frames = 100;
  o.rig_cameras = 2;
  o.points_per_frame = 80;
  return o;
}

std::vector<StepCase> scenes() {
  std::vector<StepCase> list;
  ObservationOptions plain, cauchy;
  plain.image_loss.kind = RobustLoss::Kind::kNone;
  plain.position_loss.kind = RobustLoss::Kind::kNone;
  cauchy.image_loss = {RobustLoss::Kind::kCauchy, 1.5};
  cauchy.relative_loss = {RobustLoss::Kind::kHuber, 0.5};
  list.push_back({"AerialCalibrated", aerial_steps(), plain});
  SimulationOptions held = aerial_steps();
  held.calibrate = false;
  list.push_back({"AerialHeldCamera", held, {}});
  SimulationOptions control = aerial_steps();
  control.control_points = 8;
  control.check_points = 4;
  control.gps_share = 0.3;
  control.outlier_share = 0.02;
  cauchy.control_loss = {RobustLoss::Kind::kCauchyTail, 0.5};  // some of the residuals are in the line and in the tail
  list.push_back({"AerialControlRobust", control, cauchy});
  SimulationOptions relative = street_steps();
  relative.relative_position_sigma_m = 0.02;
  relative.attitude_sigma_deg = 0.5;
  relative.gps_share = 0.2;
  list.push_back({"StreetRelative", relative, cauchy});
  list.push_back({"StreetFreeMounts", street_steps(), {}, true});
  list.push_back({"StreetDistances", street_steps(), cauchy, false, false, false, false, true});
  list.push_back({"StreetLines", street_steps(), cauchy, false, true});
  cauchy.vertical_loss = {RobustLoss::Kind::kCauchy, 2};
  list.push_back({"StreetVerticals", street_steps(), cauchy, true, false, true});
  SimulationOptions calibrated = street_steps();
  calibrated.calibrate = true;
  // Cameras that see the same points: most tracks have frames with two observations.
  SimulationOptions overlapping = calibrated;
  overlapping.rig_cameras = 10;
  list.push_back({"StreetTenCameras", overlapping, cauchy, true});
  list.push_back({"StreetCameraByCamera", overlapping, cauchy, true, false, false, true});
  list.push_back({"StreetVerticalsCalibrated", calibrated, {}, false, false, true});
  return list;
}

// What a frame sees of a point then does not follow each other. Returns the number of such tracks.
std::int64_t sort_camera_by_camera(SimulatedBlock& block) {
  std::int64_t scattered = 0;
  TrackSet& tracks = block.tracks;
  const TrackSet before = tracks;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    const auto first = static_cast<std::size_t>(tracks.begin[static_cast<std::size_t>(t)]),
               last = static_cast<std::size_t>(tracks.begin[static_cast<std::size_t>(t) + 1]);
    std::vector<std::size_t> order(last - first);
    std::iota(order.begin(), order.end(), first);
    std::ranges::stable_sort(order, {}, [&](std::size_t o) { return block.block.images[before.image[o]].mount; });
    for (std::size_t i = 0; i < order.size(); ++i) {
      tracks.image[first + i] = before.image[order[i]];
      tracks.x[first + i] = before.x[order[i]];
      tracks.y[first + i] = before.y[order[i]];
      tracks.feature[first + i] = before.feature[order[i]];
    }
    std::map<FrameIndex, std::size_t> last_of_frame;
    bool apart = false;
    for (std::size_t o = first; o < last; ++o) {
      const auto [seen, is_new] = last_of_frame.try_emplace(block.block.images[tracks.image[o]].frame, o);
      apart = apart || (!is_new && seen->second + 1 < o);
      seen->second = o;
    }
    scattered += apart;
  }
  return scattered;
}

SimulatedBlock simulated(const StepCase& scene) {
  SimulatedBlock block = simulate_block(scene.simulation);
  if (scene.camera_by_camera) {
    EXPECT_GT(sort_camera_by_camera(block), 100);
  }
  if (scene.lines) add_known_lines(block, 20, 1);
  if (scene.distances)  // within tiles and across their borders, up to the root
    for (std::int64_t f = 0; f + 30 < std::ssize(block.block.frames); f += 4) {
      const FrameIndex from(f), to(f + 1 + f % 30);
      const double truth = (block.truth.frames[to].centre - block.truth.frames[from].centre).norm();
      block.block.frame_measurements["distances"].push_back({from, to, truth + 0.01, 0.02});
    }
  if (scene.verticals)
    add_seen_verticals(block, {.noise_deg = 0.1, .wrong_share = 0.05, .by_radial = 0.02, .every = 2});
  if (scene.free_mounts)
    for (Rig& rig : block.block.rigs)
      for (std::size_t m = 1; m < rig.mounts.size(); ++m) {
        rig.mounts[m].rotation_sigma_rad = 0.01;
        rig.mounts[m].position_sigma_m = 0.05;
      }
  return block;
}

class StepEquality : public testing::TestWithParam<StepCase> {};

// Largest difference between the tiles' step and the monolithic one, in units of `sigma` [columns].
double difference(const TiledBlock& block, const MergeInMemory& runner, const MonolithicSystem& system,
                  const Eigen::VectorXd& expected, const Eigen::VectorXd& sigma) {
  double largest = 0;
  const auto compare = [&](std::int64_t column, const double* values, std::int64_t count) {
    for (std::int64_t k = 0; k < count; ++k) {
      const double share = std::abs(values[k] - expected[column + k]) / sigma[column + k];
      EXPECT_TRUE(std::isfinite(share));
      largest = std::max(largest, share);
    }
  };
  for (std::size_t t = 0; t < runner.problems().size(); ++t) {
    const TileProblem& tile = runner.problems()[t];
    const TileStep& step = runner.steps()[t];
    for (const Unknown& u : step.unknowns.unknowns) {
      std::int64_t column = -1;
      if (u.id.kind == UnknownKind::kFrame)
        column = system.frame_column[TiledBlock::row(block.whole.frames, FrameIndex(u.id.index))];
      if (u.id.kind == UnknownKind::kCamera)
        column = system.camera_column[TiledBlock::row(block.whole.cameras, CameraIndex(u.id.index))];
      if (u.id.kind == UnknownKind::kMount)
        column = system.mount_column[TiledBlock::row(block.whole.mounts, MountId{RigIndex(u.id.index), u.id.part})];
      EXPECT_GE(column, 0) << describe(u.id);
      if (column >= 0) compare(column, step.unknowns.find(u.id), u.dimension);
    }
    for (std::size_t p = 0; p < tile.points.size(); ++p) {
      const std::int64_t column = system.point_column[block.point_row(tile.points[p])];
      if (column >= 0) compare(column, step.points[p].data(), 3);
    }
  }
  return largest;
}

// Posterior sigmas of all columns: the reduced ones exactly, the points' by a lower bound (their own 3 x 3 block).
Eigen::VectorXd sigmas(const MonolithicSystem& system) {
  Eigen::VectorXd sigma(system.jacobian.cols());
  const Eigen::MatrixXd covariance = monolithic_covariance(system);
  sigma.head(system.reduced_dimension) = covariance.diagonal().cwiseSqrt();
  for (Eigen::Index p = system.reduced_dimension; p < system.jacobian.cols(); p += 3) {
    const Eigen::MatrixXd columns = system.jacobian.middleCols(p, 3);
    const Eigen::Matrix3d own = columns.transpose() * columns;
    sigma.segment<3>(p) = own.inverse().diagonal().cwiseSqrt();
  }
  return sigma;
}

TEST_P(StepEquality, OverEightTilesAndThreeLevels) {
  const TiledBlock block(simulated(GetParam()), 12, GetParam().observations, 0.05);
  ASSERT_GE(block.tiles.tile_count, 8);
  ASSERT_GE(block.levels(), 3);
  const MonolithicSystem system = monolithic_system(block.whole, block.whole_state);
  const Eigen::VectorXd sigma = sigmas(system);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  for (const double lambda : {0.0, 1e-4, 1.0}) {
    const UpReport up = runner.up(lambda);
    const DownReport down = runner.down(lambda);
    const Eigen::VectorXd expected = monolithic_step(system, lambda);
    EXPECT_LE(difference(block, runner, system, expected, sigma), 1e-7) << "lambda " << lambda;
    EXPECT_NEAR(up.sums.cost, system.cost, 1e-11 * system.cost);
    EXPECT_EQ(up.sums.unknowns, system.jacobian.cols());
    EXPECT_EQ(up.sums.residuals, system.jacobian.rows());
    EXPECT_TRUE(up.sums.held.empty());
    // d^2 = b'H^-1 b and the decrease that the linearised model predicts.
    const Eigen::VectorXd b = -system.gradient();
    EXPECT_NEAR(up.sums.decrement_squared, b.dot(expected), 1e-9 * b.dot(expected));
    const double model = 0.5 * (system.residual + system.jacobian * expected).squaredNorm();
    const double predicted = 0.5 * (up.sums.decrement_squared + lambda * down.damping_norm);
    const double plain = 0.5 * system.residual.squaredNorm();
    EXPECT_NEAR(predicted, plain - model, 1e-9 * plain);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, StepEquality, testing::ValuesIn(scenes()),
                         [](const auto& parameter) { return parameter.param.name; });

}  // namespace
}  // namespace megablock
