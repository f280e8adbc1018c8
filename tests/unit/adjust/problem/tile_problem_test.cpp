#include "adjust/problem/tile_problem.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/build_problem.h"
#include "io/base/error.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Six single images of two cameras. Frames 0 to 2 are in tile 0, 3 to 5 in tile 1. Everything has a prior.
class TwoTiles : public testing::Test {
 protected:
  TwoTiles() {
    for (int c = 0; c < 2; ++c) {
      Camera camera;
      camera.name = "camera" + std::to_string(c);
      camera.width = 1000, camera.height = 800;
      camera.intrinsics = {900, 500, 400, 0, 0, 0, 0, 0};
      camera.prior_sigma = {10, 0, 0, kInfinity, 0, 0, 0, 0};
      block_.cameras.push_back(camera);
      Rig rig;
      rig.name = "rig" + std::to_string(c);
      rig.mounts.push_back({CameraIndex(c), {}, 0, 0});
      block_.rigs.push_back(rig);
    }
    for (int f = 0; f < 6; ++f) {
      Frame frame;
      frame.name = "f" + std::to_string(f);
      frame.rig = RigIndex(f == 5 ? 1 : 0);
      frame.position_prior.emplace();
      frame.attitude_prior.emplace();
      frame.given_pose.emplace();
      frame.given_pose->centre = {10.0 * f, 0, 0};
      block_.frames.push_back(frame);
      block_.add_image("i" + std::to_string(f), {FrameIndex(f), 0, 0});
      tiles_.tile_of_frame.push_back(TileIndex(f / 3));
    }
    tiles_.tile_count = 2;
    tracks_.begin.push_back(0);
  }

  void add_track(std::vector<std::int64_t> images) {
    tracks_.id.emplace_back(tracks_.track_count());
    for (std::int64_t image : images) {
      tracks_.image.emplace_back(image);
      tracks_.x.push_back(to_fixed_pixel(100.5 + static_cast<double>(image)));
      tracks_.y.push_back(to_fixed_pixel(200.25));
      tracks_.feature.push_back(-1);
    }
    tracks_.begin.push_back(tracks_.observation_count());
  }
  void add_control(PointRole role, std::vector<std::int64_t> images) {
    ControlPoint point;
    point.name = "c" + std::to_string(block_.control_points.size());
    point.role = role;
    point.position = {1, 2, 3};
    for (std::int64_t image : images) point.measurements.push_back({ImageIndex(image), {300, 400}, 0.25});
    block_.control_points.push_back(point);
  }
  TileIndex owner(std::vector<std::int64_t> values) const {
    std::vector<ImageIndex> images(values.begin(), values.end());
    return owner_tile(block_, tiles_, images.data(), images.data() + images.size());
  }
  TileProblem make(int tile) const {
    return make_tile_problem(block_, initial_state(block_), tiles_, TileIndex(tile), tracks_, options_);
  }

  Block block_;
  Tiles tiles_;
  TrackSet tracks_;
  ObservationOptions options_;
};

TEST_F(TwoTiles, MostFramesOwnATrackAndTiesGoToTheLowerTile) {
  EXPECT_EQ(owner({0, 1, 3}), TileIndex(0));
  EXPECT_EQ(owner({0, 3, 4}), TileIndex(1));
  EXPECT_EQ(owner({3, 2}), TileIndex(0));
  EXPECT_EQ(owner_tile(tiles_, FrameIndex(2), FrameIndex(3)), TileIndex(0));
  tiles_.separator_depth.assign(tiles_.tile_of_frame.size(), -1);
  tiles_.separator_depth[FrameIndex(2)] = 0;
  EXPECT_EQ(owner({3, 2}), TileIndex(1));
  EXPECT_EQ(owner_tile(tiles_, FrameIndex(2), FrameIndex(3)), TileIndex(1));
  tiles_.separator_depth.clear();
  tiles_.tile_of_frame[FrameIndex(0)] = tiles_.tile_of_frame[FrameIndex(1)] = TileIndex();
  EXPECT_EQ(owner({0, 1, 3}), TileIndex(1));
  EXPECT_FALSE(owner({0, 1}).valid());
  EXPECT_FALSE(owner({}).valid());
  EXPECT_FALSE(owner_tile(tiles_, FrameIndex(1), FrameIndex(3)).valid());
}

TEST_F(TwoTiles, TablesHoldTheFramesThatOwnedRowsTouch) {
  add_track({0, 1, 3});
  const TileProblem problem = make(0);
  // Frame 3 of the neighbour through the track, frame 2 through its own prior.
  EXPECT_EQ(problem.frames, (std::vector<FrameIndex>{FrameIndex(0), FrameIndex(1), FrameIndex(2), FrameIndex(3)}));
  ASSERT_EQ(problem.images.size(), 3u);
  EXPECT_EQ(problem.images[2].image, ImageIndex(3));
  EXPECT_EQ(problem.images[2].frame, LocalFrame(3));
  EXPECT_EQ(problem.begin, (std::vector<std::int64_t>{0, 3}));
  EXPECT_EQ(problem.x[1], 101.5);
  EXPECT_EQ(problem.y[1], 200.25);
  EXPECT_EQ(problem.inverse_sigma[1], 2);
  EXPECT_TRUE(problem.active(0));
  EXPECT_EQ(problem.cameras, std::vector<CameraIndex>{CameraIndex(0)});
  EXPECT_EQ(problem.camera_free[0], 1u << kFocal | 1u << kRadial1);
  EXPECT_EQ(problem.mount_free[0], 0);
  // The neighbour's frame brings no prior along.
  ASSERT_EQ(problem.positions.size(), 3u);
  for (const auto& term : problem.positions) EXPECT_NE(problem.frames[term.frame.value], FrameIndex(3));
}

TEST_F(TwoTiles, EveryPriorBelongsToOneTile) {
  add_track({0, 1, 2});
  block_.relative_poses.push_back({FrameIndex(4), FrameIndex(2), {}, 0.01, 0.1});
  block_.relative_poses.push_back({FrameIndex(4), FrameIndex(5), {}, 0.01, 0.1});
  const TileProblem first = make(0);
  tracks_ = {};
  tracks_.begin.push_back(0);
  add_track({2, 3, 4});
  const TileProblem second = make(1);
  EXPECT_EQ(first.positions.size(), 3u);
  EXPECT_EQ(second.positions.size(), 3u);
  EXPECT_EQ(first.attitudes.size(), 3u);
  ASSERT_EQ(first.relatives.size(), 1u);
  EXPECT_EQ(first.frames[first.relatives[0].from.value], FrameIndex(4));
  EXPECT_EQ(first.frames[first.relatives[0].to.value], FrameIndex(2));
  EXPECT_EQ(second.relatives.size(), 1u);
  // Camera 0 is first used in tile 0, camera 1 in tile 1; only finite sigmas are a prior.
  ASSERT_EQ(first.intrinsic_priors.size(), 1u);
  EXPECT_EQ(first.cameras[first.intrinsic_priors[0].camera.value], CameraIndex(0));
  ASSERT_EQ(second.intrinsic_priors.size(), 1u);
  EXPECT_EQ(second.cameras[second.intrinsic_priors[0].camera.value], CameraIndex(1));
  EXPECT_EQ(intrinsic_prior_weight(first.intrinsic_priors[0], kFocal), 0.1);
  EXPECT_EQ(intrinsic_prior_weight(first.intrinsic_priors[0], kRadial1), 0);
  options_.use_position_priors = options_.use_attitude_priors = false;
  EXPECT_TRUE(make(1).positions.empty());
  EXPECT_TRUE(make(1).attitudes.empty());
}

TEST_F(TwoTiles, ControlPointsFollowTheTracks) {
  add_track({0, 1});
  add_control(PointRole::kCheck, {0, 1});
  add_control(PointRole::kControl, {3, 4, 0});
  add_control(PointRole::kControl, {1, 3});
  block_.control_points[2].position.z() = std::numeric_limits<double>::quiet_NaN();
  add_control(PointRole::kControl, {2});
  const TileProblem problem = make(0);
  ASSERT_EQ(problem.point_count(), 4);
  EXPECT_EQ(problem.begin, (std::vector<std::int64_t>{0, 2, 4, 6, 7}));
  EXPECT_EQ(problem.points[1].role, PointRole::kCheck);
  EXPECT_EQ(problem.points[2].index, 2);
  EXPECT_EQ(problem.inverse_sigma[2], 4);
  // The check point has no prior; an unknown height is free.
  ASSERT_EQ(problem.point_priors.size(), 2u);
  EXPECT_EQ(problem.point_priors[0].point, LocalPoint(2));
  EXPECT_TRUE(std::isinf(problem.point_priors[0].sigma.z()));
  EXPECT_TRUE(problem.point_priors[0].position.allFinite());
  // One observation and a prior take part, one observation alone does not.
  EXPECT_TRUE(problem.active(3));
  TileProblem fewer = problem;
  fewer.kept[0] = fewer.kept[2] = 0;
  EXPECT_FALSE(fewer.active(0));
  EXPECT_FALSE(fewer.active(1));
}

TEST_F(TwoTiles, RowsOfImagesWithoutPoseStayButAreNotKept) {
  add_track({0, 1, 4});
  block_.frames[FrameIndex(1)].given_pose.reset();
  block_.relative_poses.push_back({FrameIndex(1), FrameIndex(2), {}, 0.01, 0.1});
  const TileProblem problem = make(0);
  EXPECT_EQ(problem.kept, (std::vector<std::uint8_t>{1, 0, 1}));
  EXPECT_FALSE(problem.image[1].valid());
  EXPECT_TRUE(problem.image[2].valid());
  EXPECT_TRUE(problem.relatives.empty());
  EXPECT_EQ(problem.positions.size(), 2u);
}

TEST_F(TwoTiles, FreeMountsAndTheirPriors) {
  block_.rigs[RigIndex(0)].mounts.push_back({CameraIndex(1), {}, 0.01, 0});
  block_.images[ImageIndex(1)].mount = 1;
  block_.images[ImageIndex(1)].frame = FrameIndex(0);
  add_track({0, 1, 2});
  const TileProblem problem = make(0);
  ASSERT_EQ(problem.mounts.size(), 2u);
  EXPECT_EQ(problem.mount_free, (std::vector<std::uint8_t>{0, 1}));
  ASSERT_EQ(problem.mount_priors.size(), 1u);
  EXPECT_EQ(problem.mount_priors[0].rotation_sigma_rad, 0.01);
  EXPECT_LE(problem.mount_priors[0].position_sigma_m, 1e-6);  // held by its prior
}

TEST_F(TwoTiles, StateGoesThereAndBack) {
  add_track({0, 1, 3});
  const TileProblem problem = make(0);
  BlockState state = initial_state(block_);
  TileState tile = make_tile_state(problem, state, {{1, 2, 3}});
  EXPECT_EQ(tile.frames[3].centre.x(), 30);
  tile.frames[3].centre.x() = 31;
  tile.cameras[0][kFocal] = 901;
  store_tile_state(problem, tile, state);
  EXPECT_EQ(state.frames[FrameIndex(3)].centre.x(), 31);
  EXPECT_EQ(state.cameras[CameraIndex(0)][kFocal], 901);
  EXPECT_EQ(state.cameras[CameraIndex(1)][kFocal], 900);
}

TEST_F(TwoTiles, RefusesBadInput) {
  add_track({0, 1});
  EXPECT_THROW(make_tile_state(make(0), initial_state(block_), {}), InputError);
  options_.image_sigma_px = 0;
  EXPECT_THROW(make(0), InputError);
  options_ = {};
  options_.position_loss.scale = -1;
  EXPECT_THROW(make(0), InputError);
  options_ = {};
  tiles_.tile_of_frame.pop_back();
  EXPECT_THROW(make(0), ComputeError);
}

// Whatever the tiles, their residuals together are those of the whole block.
TEST(TileProblem, TilesShareNoResidualAndMissNone) {
  SimulationOptions options;
  options.frames = 40;
  options.points_per_frame = 60;
  options.attitude_sigma_deg = 1;
  options.relative_position_sigma_m = 0.05;
  options.control_points = 8;
  options.check_points = 4;
  SimulatedBlock simulated = simulate_block(options);
  for (std::int64_t i = 0; i < 40; i += 3) simulated.block.verticals.emplace_back().image = ImageIndex(i);
  const BlockState state = initial_state(simulated.block);
  const auto cost = [&](const Tiles& tiles, TileIndex tile) {
    TrackSet owned;
    std::vector<Eigen::Vector3d> points;
    owned.begin.push_back(0);
    const TrackSet& all = simulated.tracks;
    for (std::int64_t t = 0; t < all.track_count(); ++t) {
      if (owner_tile(simulated.block, tiles, &all.image[all.begin[t]], all.image.data() + all.begin[t + 1]) != tile)
        continue;
      owned.id.push_back(all.id[t]);
      for (std::int64_t row = all.begin[t]; row < all.begin[t + 1]; ++row) {
        owned.image.push_back(all.image[row]);
        owned.x.push_back(all.x[row]);
        owned.y.push_back(all.y[row]);
      }
      owned.begin.push_back(owned.observation_count());
      points.push_back(simulated.points[t]);
    }
    const TileProblem problem = make_tile_problem(simulated.block, state, tiles, tile, owned, {});
    for (const TilePoint& point : problem.points)
      if (point.role != PointRole::kTie) points.push_back(simulated.control_truth[point.index]);
    return evaluate_cost(problem, make_tile_state(problem, state, points));
  };
  const double whole = cost(single_tile(simulated.block), TileIndex(0));
  Tiles three = single_tile(simulated.block);
  three.tile_count = 3;
  for (std::int64_t f = 0; f < 40; ++f) three.tile_of_frame[FrameIndex(f)] = TileIndex((f * 7 / 40) % 3);
  double sum = 0;
  for (int t = 0; t < 3; ++t) sum += cost(three, TileIndex(t));
  EXPECT_TRUE(std::isfinite(whole));
  EXPECT_NEAR(sum, whole, 1e-9 * whole);
  const RowsOfTiles dealt = rows_of_tiles(simulated.block, state, three);
  ASSERT_EQ(dealt.size(), 3u);
  const auto all = [&](auto member) {
    return (dealt[0].*member).size() + (dealt[1].*member).size() + (dealt[2].*member).size();
  };
  EXPECT_EQ(all(&RowsOfTile::verticals), 14u);
  EXPECT_EQ(all(&RowsOfTile::relative_poses), simulated.block.relative_poses.size());
  EXPECT_EQ(all(&RowsOfTile::cameras), simulated.block.cameras.size());
}

}  // namespace
}  // namespace megablock
