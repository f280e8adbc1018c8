#include "adjust/orientation/orientation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <string>
#include <utility>

#include "io/base/error.h"
#include "tests/support/adjust/orientation_scene.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/io/image_names.h"

namespace megablock {
namespace {

using namespace orientation_scene;

std::vector<Eigen::Vector3d> random_points(int count, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  std::mt19937_64 random(99);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d u(uniform(random), uniform(random), uniform(random));
    points.push_back(low + u.cwiseProduct(high - low));
  }
  return points;
}

// Nadir images 80 m above terrain of +-5 m, rows flown to and fro, small random tilts.
SimulatedBlock aerial(int rows, int columns, const SceneOptions& options, double relief = 5, double heights = 0.5) {
  std::mt19937_64 random(3);
  std::vector<Pose> poses;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const Eigen::Vector3d down(0, r % 2 ? -1 : 1, 0);
      const Eigen::Quaterniond tilt = rotation_exp<double>(2 * kDegree * normal_vector(random));
      poses.push_back({(tilt * looking({0, 0, -1}, down)).normalized(),
                       Eigen::Vector3d(14 * c, 30 * r, 80) +
                           Eigen::Vector3d(0.5, 0.5, heights).cwiseProduct(normal_vector(random))});
    }
  return make_scene(
      poses, random_points(rows * columns * 60, {-50, -50, -relief}, {14.0 * columns + 50, 30.0 * rows + 50, relief}),
      options);
}

// Two strips of nadir images that see 19 degrees only, 100 m above terrain of +-5 m.
SimulatedBlock narrow_strips(SceneOptions options) {
  std::mt19937_64 random(7);
  std::vector<Pose> poses;
  for (int r = 0; r < 2; ++r)
    for (int c = 0; c < 6; ++c) {
      const Eigen::Quaterniond tilt = rotation_exp<double>(1 * kDegree * normal_vector(random));
      poses.push_back({(tilt * looking({0, 0, -1}, {0, r % 2 ? -1.0 : 1.0, 0})).normalized(),
                       Eigen::Vector3d(5 * c, 10 * r, 100) + 0.5 * normal_vector(random)});
    }
  options.focal_px = 4400;
  return make_scene(poses, random_points(1500, {-15, -15, -5}, {40, 25, 5}), options);
}

// A camera driven forward between facades, y down.
SimulatedBlock street(int frames, const SceneOptions& options) {
  std::mt19937_64 random(4);
  std::vector<Pose> poses;
  for (int i = 0; i < frames; ++i) {
    const Eigen::Quaterniond sway = rotation_exp<double>(1 * kDegree * normal_vector(random));
    poses.push_back({(sway * looking({0.6, 0.8, 0}, {0, 0, -1})).normalized(),
                     Eigen::Vector3d(1.8 * i, 2.4 * i, 2) + 0.05 * normal_vector(random)});
  }
  std::vector<Eigen::Vector3d> points;
  for (Eigen::Vector3d p : random_points(frames * 60, {0, -1, 0}, {3.0 * frames + 50, 1, 12})) {
    const double side = p.y() > 0 ? 8 + p.y() : -8 + p.y();  // along the street, across it, up
    points.push_back({0.6 * p.x() - 0.8 * side, 0.8 * p.x() + 0.6 * side, p.z()});
  }
  SceneOptions near = options;
  near.max_distance_m = 45;
  return make_scene(poses, points, near);
}

// Cameras on a circle that look at an object in its middle.
SimulatedBlock ring(int frames, const SceneOptions& options) {
  std::mt19937_64 random(5);
  std::vector<Pose> poses;
  for (int i = 0; i < frames; ++i) {
    const double angle = 2 * std::numbers::pi * i / frames;
    const Eigen::Vector3d centre =
        Eigen::Vector3d(10 * std::cos(angle), 10 * std::sin(angle), 3) + 0.2 * normal_vector(random);
    poses.push_back({looking(Eigen::Vector3d(0, 0, 1) - centre, {0, 0, -1}), centre});
  }
  SimulatedBlock scene = make_scene(poses, random_points(1500, {-2, -2, 0}, {2, 2, 3}), options);
  // An opaque object: a point is seen from its own side only.
  TrackSet seen;
  seen.begin = {0};
  for (std::size_t t = 0; t < scene.tracks.id.size(); ++t) {
    for (auto o = static_cast<std::size_t>(scene.tracks.begin[t]);
         o < static_cast<std::size_t>(scene.tracks.begin[t + 1]); ++o) {
      const Eigen::Vector3d& centre = poses[static_cast<std::size_t>(scene.tracks.image[o].value)].centre;
      if (scene.points[t].head<2>().normalized().dot(centre.head<2>().normalized()) < 0.5) continue;
      seen.image.push_back(scene.tracks.image[o]);
      seen.x.push_back(scene.tracks.x[o]);
      seen.y.push_back(scene.tracks.y[o]);
      seen.feature.push_back(-1);
    }
    seen.id.push_back(TrackIndex(static_cast<std::int64_t>(t)));
    seen.begin.push_back(static_cast<std::int64_t>(seen.image.size()));
  }
  scene.tracks = seen;
  return scene;
}

void expect_oriented(const SimulatedBlock& scene, const OrientationResult& result, bool free, double position_m,
                     double rotation_deg) {
  const Errors errors = errors_of(scene, result, free);
  EXPECT_EQ(errors.oriented, scene.block.frames.size());
  EXPECT_LT(errors.position_m, position_m);
  EXPECT_LT(errors.rotation_deg, rotation_deg);
}

TEST(Orientation, AerialBlock) {
  const SimulatedBlock free = aerial(4, 7, {});
  expect_oriented(free, orient(free, pairs_of(free)), true, 0.3, 0.3);
  SceneOptions options;
  options.gps_sigma_m = 1;
  const SimulatedBlock positioned = aerial(4, 7, options);
  expect_oriented(positioned, orient(positioned, pairs_of(positioned)), false, 1.5, 2);
}

TEST(Orientation, AerialBlockOverFlatGroundWithUnknownFocalLength) {
  SceneOptions options;
  options.gps_sigma_m = 1;
  for (double guess : {0.8, 1.25}) {
    options.focal_guess = guess;
    const SimulatedBlock scene = aerial(4, 7, options, 0.01);
    const auto result = orient(scene, pairs_of(scene));
    expect_oriented(scene, result, false, 4, 3);
  }
}

// A pinhole has as many parameters as a point has coordinates. The adjustment must not take one for the other.
TEST(Orientation, FindsTheFocalLengthOfAPinhole) {
  SceneOptions options;
  options.gps_sigma_m = 1;
  options.focal_guess = 0.9;
  SimulatedBlock scene = aerial(4, 7, options);
  for (Camera& camera : scene.block.cameras) {
    const Intrinsics brown = camera.intrinsics;
    camera.intrinsics = Intrinsics(*find_model("pinhole"), {brown[kFocal], brown[kPrincipalX], brown[kPrincipalY]});
    camera.prior_sigma = weak_sigmas(camera.intrinsics, 0.3 * brown[kFocal], camera.width);
  }
  scene.truth.cameras = initial_state(scene.block).cameras;
  for (Intrinsics& camera : scene.truth.cameras) camera[kFocal] = options.focal_px;
  const OrientationResult result = orient(scene, pairs_of(scene));
  expect_oriented(scene, result, false, 4, 3);
  EXPECT_NEAR(result.state.cameras[CameraIndex(0)][kFocal], options.focal_px, 0.05 * options.focal_px);
}

// Relative rotations of narrow images are poor, and with them the directions of their baselines. The first centres are
// so bent that the positions, good to centimetres, do not fit them.
TEST(Orientation, PositionsPlaceNarrowImages) {
  SceneOptions options;
  options.gps_sigma_m = 0.03;
  const SimulatedBlock scene = narrow_strips(options);
  for (const double rotation_deg : {4.0, 6.0}) {
    const PairNoise noise{.rotation_deg = rotation_deg};
    expect_oriented(scene, orient(scene, pairs_of(scene, noise)), false, 2, 2);
  }
}

// Such positions turn the block over, and its heights hardly contradict them.
TEST(Orientation, PositionsWithEastAndNorthExchangedLeaveTheBlockFree) {
  SceneOptions options;
  options.gps_sigma_m = 0.05;
  SimulatedBlock scene = aerial(4, 7, options, 5, 4);
  const OrientationResult right = orient(scene, pairs_of(scene));
  expect_oriented(scene, right, false, 1, 1);
  EXPECT_THAT(right.summary, testing::HasSubstr("ground frame"));
  for (Frame& frame : scene.block.frames) {
    Eigen::Vector3d& position = frame.position_prior->position;
    std::swap(position.x(), position.y());
  }
  const OrientationResult mirrored = orient(scene, pairs_of(scene));
  expect_oriented(scene, mirrored, true, 0.3, 0.3);
  EXPECT_THAT(mirrored.summary, testing::HasSubstr("free block"));
}

TEST(Orientation, SingleFlightLineLooksDown) {
  SceneOptions options;
  options.gps_sigma_m = 0.5;
  const SimulatedBlock scene = aerial(1, 12, options);
  expect_oriented(scene, orient(scene, pairs_of(scene)), false, 5, 5);
}

TEST(Orientation, StreetKeepsItsCameraUpright) {
  const SimulatedBlock free = street(25, {});
  expect_oriented(free, orient(free, pairs_of(free)), true, 0.1, 1);
  SceneOptions options;
  options.gps_sigma_m = 0.5;
  const SimulatedBlock positioned = street(25, options);
  expect_oriented(positioned, orient(positioned, pairs_of(positioned)), false, 1.5, 4);
}

TEST(Orientation, RingAroundAnObject) {
  const SimulatedBlock scene = ring(30, {});
  expect_oriented(scene, orient(scene, pairs_of(scene)), true, 0.05, 0.3);
}

TEST(Orientation, SimulatedStreetOfRigsWithPositions) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 40;
  options.start_position_error_m = options.start_rotation_error_deg = -1;
  options.outlier_share = 0.05;
  options.gps_sigma_m = 3;
  const SimulatedBlock scene = simulate_block(options);
  expect_oriented(scene, orient(scene, pairs_of(scene)), false, 3, 3);
}

// The same scene with frames, images and tracks in another order.
struct Permuted {
  SimulatedBlock scene;
  std::vector<VerifiedPair> pairs;
  std::vector<std::int64_t> place;  // of the old frame in the new block
};

Permuted permuted(const SimulatedBlock& scene, std::vector<VerifiedPair> pairs) {
  Permuted result{scene, {}, {}};
  std::mt19937_64 random(8);
  const std::size_t count = scene.block.frames.size();
  result.place.resize(count);
  std::iota(result.place.begin(), result.place.end(), 0);
  std::shuffle(result.place.begin(), result.place.end(), random);
  for (std::size_t i = 0; i < count; ++i) {
    const auto from = static_cast<std::int64_t>(i);
    const std::int64_t to = result.place[i];
    result.scene.block.frames[FrameIndex(to)] = scene.block.frames[FrameIndex(from)];
    result.scene.block.images[ImageIndex(to)] = scene.block.images[ImageIndex(from)];
    result.scene.block.images[ImageIndex(to)].frame = FrameIndex(to);
    result.scene.truth.frames[FrameIndex(to)] = scene.truth.frames[FrameIndex(from)];
  }
  std::vector<std::string> names(count);
  for (std::size_t i = 0; i < count; ++i)
    names[static_cast<std::size_t>(result.place[i])] = scene.block.name_of(ImageIndex(static_cast<std::int64_t>(i)));
  rename_images(result.scene.block, [&](ImageIndex image) { return names[static_cast<std::size_t>(image.value)]; });
  std::vector<std::size_t> order(scene.tracks.id.size());
  std::iota(order.begin(), order.end(), 0u);
  std::shuffle(order.begin(), order.end(), random);
  TrackSet& tracks = result.scene.tracks;
  tracks = {};
  tracks.begin = {0};
  for (std::size_t t : order) {
    std::vector<std::array<std::int64_t, 3>> rows;
    for (auto o = static_cast<std::size_t>(scene.tracks.begin[t]);
         o < static_cast<std::size_t>(scene.tracks.begin[t + 1]); ++o)
      rows.push_back(
          {result.place[static_cast<std::size_t>(scene.tracks.image[o].value)], scene.tracks.x[o], scene.tracks.y[o]});
    std::sort(rows.begin(), rows.end());
    for (const auto& [image, x, y] : rows) {
      tracks.image.push_back(ImageIndex(image));
      tracks.x.push_back(static_cast<std::int32_t>(x));
      tracks.y.push_back(static_cast<std::int32_t>(y));
      tracks.feature.push_back(-1);
    }
    tracks.id.push_back(TrackIndex(tracks.track_count()));
    tracks.begin.push_back(tracks.observation_count());
  }
  std::shuffle(pairs.begin(), pairs.end(), random);
  for (VerifiedPair& pair : pairs) {
    pair.a = ImageIndex(result.place[static_cast<std::size_t>(pair.a.value)]);
    pair.b = ImageIndex(result.place[static_cast<std::size_t>(pair.b.value)]);
    if (pair.a < pair.b) continue;
    std::swap(pair.a, pair.b);
    const auto& q = pair.rotation_wxyz;
    const Eigen::Quaterniond back(q[0], -q[1], -q[2], -q[3]);
    const Eigen::Vector3d t = -(back * Eigen::Vector3d(pair.translation[0], pair.translation[1], pair.translation[2]));
    pair.rotation_wxyz = {back.w(), back.x(), back.y(), back.z()};
    pair.translation = {t.x(), t.y(), t.z()};
  }
  result.pairs = std::move(pairs);
  return result;
}

TEST(Orientation, DoesNotDependOnTheOrderOfImages) {
  SceneOptions options;
  for (double gps : {0.0, 1.0}) {
    options.gps_sigma_m = gps;
    for (const SimulatedBlock& scene : {aerial(3, 5, options), ring(20, options)}) {
      const auto pairs = pairs_of(scene);
      const Permuted other = permuted(scene, pairs);
      const auto a = orient(scene, pairs), b = orient(other.scene, other.pairs);
      for (FrameIndex f : all_frames(scene.block)) {
        const FrameIndex g(other.place[static_cast<std::size_t>(f.value)]);
        ASSERT_EQ(a.state.oriented[f], b.state.oriented[g]);
        EXPECT_LT((a.state.frames[f].centre - b.state.frames[g].centre).norm(), 1e-9) << gps;
        EXPECT_LT(rotation_angle(a.state.frames[f].rotation, b.state.frames[g].rotation), 1e-9);
      }
    }
  }
}

TEST(Orientation, PositionsFarOffDoNotMoveTheBlock) {
  SceneOptions options;
  options.gps_sigma_m = 1;
  SimulatedBlock scene = aerial(4, 6, options);
  scene.block.frames[FrameIndex(3)].position_prior->position += Eigen::Vector3d(10000, 0, 0);
  scene.block.frames[FrameIndex(11)].position_prior->position += Eigen::Vector3d(0, -300, 50);
  scene.block.frames[FrameIndex(17)].position_prior.reset();
  expect_oriented(scene, orient(scene, pairs_of(scene)), false, 2, 2);
}

TEST(Orientation, AttitudePriorsTurnAFreeBlock) {
  SimulatedBlock scene = aerial(3, 6, {});
  std::mt19937_64 random(6);
  for (FrameIndex f : all_frames(scene.block)) {
    auto& prior = scene.block.frames[f].attitude_prior.emplace();
    prior.rotation_cw = rotation_update(scene.truth.frames[f].rotation, 2 * kDegree * normal_vector(random));
    prior.sigma_rad.setConstant(2 * kDegree);
  }
  const auto result = orient(scene, pairs_of(scene));
  double largest = 0;
  for (FrameIndex f : all_frames(scene.block))
    largest =
        std::max(largest, rotation_angle(result.state.frames[f].rotation, scene.truth.frames[f].rotation) / kDegree);
  EXPECT_LT(largest, 2);
}

// A free block is level, one in ten of its verticals anywhere; so is a street whose positions lie on a line.
TEST(Orientation, VerticalsLevelABlock) {
  SceneOptions positions;
  positions.gps_sigma_m = 3;
  for (SimulatedBlock scene : {ring(20, {}), street(30, {}), street(30, positions), aerial(4, 7, positions)}) {
    const double without = off_level_deg(scene, orient(scene, pairs_of(scene)));
    add_seen_verticals(scene, {.sigma_deg = 0.1, .noise_deg = 0.1, .wrong_share = 0.1});
    const auto result = orient(scene, pairs_of(scene));
    EXPECT_LT(errors_of(scene, result, true).position_m, 0.5);
    EXPECT_EQ(errors_of(scene, result, true).oriented, scene.block.frames.size());
    EXPECT_LT(off_level_deg(scene, result), 0.15) << "without: " << without;
  }
}

// Half of the verticals anywhere: as level as with the other half alone.
TEST(Orientation, WrongVerticalsAreSetAside) {
  SceneOptions positions;
  positions.gps_sigma_m = 3;
  for (SimulatedBlock scene : {ring(20, {}), street(30, {}), street(30, positions), aerial(4, 7, positions)}) {
    add_seen_verticals(scene, {.sigma_deg = 0.1, .noise_deg = 0.1});
    std::set<ImageIndex> wrong;
    std::mt19937_64 random(6);
    for (std::size_t v = 0; v < scene.block.verticals.size(); v += 2) {
      SeenVertical& vertical = scene.block.verticals[v];
      do vertical.down = normal_vector(random).normalized();
      while (vertical.down.dot(scene.truth.frames[scene.block.images[vertical.image].frame].rotation *
                               -Eigen::Vector3d::UnitZ()) > 0.7);
      wrong.insert(vertical.image);
    }
    const auto result = orient(scene, pairs_of(scene));
    std::set<ImageIndex> aside;
    for (const SetAsideVertical& vertical : result.verticals_aside) aside.insert(vertical.image);
    EXPECT_EQ(aside, wrong);
    EXPECT_LT(errors_of(scene, result, true).position_m, 0.5);
    EXPECT_LT(off_level_deg(scene, result), 0.2);
    std::erase_if(scene.block.verticals, [&](const SeenVertical& vertical) { return wrong.contains(vertical.image); });
    EXPECT_EQ(orient(scene, pairs_of(scene)).state.frames[FrameIndex(0)].centre,
              result.state.frames[FrameIndex(0)].centre);
  }
}

// Verticals that are all wrong leave nothing behind: rows of fields from above, and any.
TEST(Orientation, VerticalsOfFieldsLeaveNothingBehind) {
  SceneOptions positions;
  positions.gps_sigma_m = 3;
  for (const bool rows : {true, false}) {
    SimulatedBlock scene = aerial(4, 7, positions);
    const auto without = orient(scene, pairs_of(scene));
    EXPECT_TRUE(without.verticals_aside.empty());
    add_seen_verticals(scene, {.sigma_deg = 0.1, .noise_deg = 0.1});
    std::mt19937_64 random(6);
    for (SeenVertical& vertical : scene.block.verticals) {
      const Pose& frame = scene.truth.frames[scene.block.images[vertical.image].frame];
      vertical.down =
          rows ? Eigen::Vector3d(frame.rotation * Eigen::Vector3d::UnitX()) : normal_vector(random).normalized();
      const Eigen::Matrix<double, 3, 2> across = tangent_plane(vertical.down);
      vertical.covariance = std::pow(0.1 * kDegree, 2) * across * across.transpose();
    }
    const auto result = orient(scene, pairs_of(scene));
    EXPECT_EQ(result.verticals_aside.size(), scene.block.verticals.size());
    if (rows) {
      for (const SetAsideVertical& vertical : result.verticals_aside)
        EXPECT_EQ(vertical.verdict, VerticalVerdict::kAgainstGround);
    }
    for (const FrameIndex f : all_frames(scene.block)) {
      EXPECT_EQ(result.state.frames[f].centre, without.state.frames[f].centre);
      EXPECT_EQ(result.state.frames[f].rotation.coeffs(), without.state.frames[f].rotation.coeffs());
    }
  }
}

TEST(Orientation, ResectsAnImageWhoseRelativeRotationsAreAllWrong) {
  const SimulatedBlock scene = aerial(4, 6, {});
  auto pairs = pairs_of(scene);
  std::mt19937_64 random(7);
  for (VerifiedPair& pair : pairs) {
    if (pair.a.value != 8 && pair.b.value != 8) continue;
    const Eigen::Quaterniond wrong = rotation_exp<double>(normal_vector(random));
    pair.rotation_wxyz = {wrong.w(), wrong.x(), wrong.y(), wrong.z()};
  }
  expect_oriented(scene, orient(scene, pairs), true, 0.3, 0.3);
}

TEST(Orientation, GivenPosesStayAndOrientTheOthers) {
  const SimulatedBlock scene = aerial(4, 6, {});
  BlockState start = initial_state(scene.block);
  for (std::int64_t f : {0, 1, 2, 3, 4, 5, 8, 9, 10, 12, 14, 15, 20}) {
    start.oriented[FrameIndex(f)] = 1;
    start.frames[FrameIndex(f)] = scene.truth.frames[FrameIndex(f)];
  }
  const auto result = orient_component(scene.block, start, all_frames(scene.block), pairs_of(scene), scene.tracks, {});
  expect_oriented(scene, result, false, 0.5, 0.5);
  for (FrameIndex f : all_frames(scene.block)) {
    if (!start.oriented[f]) continue;
    EXPECT_EQ(result.state.frames[f].centre, start.frames[f].centre);
    EXPECT_EQ(result.state.frames[f].rotation.coeffs(), start.frames[f].rotation.coeffs());
  }
}

TEST(Orientation, ApproximateGivenPosesOrientTheOthersToTheirAccuracy) {
  const SimulatedBlock scene = aerial(4, 6, {});
  BlockState start = initial_state(scene.block);
  std::mt19937_64 random(12);
  for (std::int64_t f = 0; f < 24; f += 2) {
    start.oriented[FrameIndex(f)] = 1;
    Pose pose = scene.truth.frames[FrameIndex(f)];
    pose.centre += 0.5 * normal_vector(random);
    pose.rotation = rotation_update(pose.rotation, 0.5 * kDegree * normal_vector(random));
    start.frames[FrameIndex(f)] = pose;
  }
  const auto result = orient_component(scene.block, start, all_frames(scene.block), pairs_of(scene), scene.tracks, {});
  expect_oriented(scene, result, false, 3, 3);
}

TEST(Orientation, ReportsImagesThatNothingLinks) {
  SimulatedBlock scene = aerial(2, 6, {});
  scene.block.add_image("alone", {FrameIndex(12), 0, 0});
  Frame alone;
  alone.name = "alone";
  alone.rig = RigIndex(0);
  scene.block.frames.push_back(alone);
  scene.truth.frames.push_back({});
  const auto result = orient(scene, pairs_of(scene));
  ASSERT_EQ(result.failed.size(), 1u);
  EXPECT_EQ(result.failed[0].first, FrameIndex(12));
  EXPECT_FALSE(result.failed[0].second.empty());
  EXPECT_EQ(result.state.oriented[FrameIndex(12)], 0);
  EXPECT_EQ(errors_of(scene, result, true).oriented, 12u);
}

TEST(Orientation, PairsWithoutARotationAreLeftOut) {
  const SimulatedBlock scene = aerial(2, 6, {});
  auto pairs = pairs_of(scene);
  pairs[3].rotation_wxyz = {0, 0, 0, 0};
  pairs[7].rotation_wxyz[0] = std::nan("");
  pairs[9].translation[1] = std::nan("");
  expect_oriented(scene, orient(scene, pairs), true, 0.3, 0.3);
}

TEST(Orientation, RefusesWhatCannotBeOriented) {
  const SimulatedBlock scene = aerial(1, 3, {});
  EXPECT_THROW(orient(scene, {}), ComputeError);
  EXPECT_THROW(orient_component(scene.block, initial_state(scene.block), {}, {}, scene.tracks, {}), ComputeError);
  SimulatedBlock empty = scene;
  empty.tracks = {};
  empty.tracks.begin = {0};
  EXPECT_THROW(orient(empty, pairs_of(scene)), ComputeError);
  OrientationOptions bad;
  bad.max_rotation_error_deg = -1;
  EXPECT_THROW(
      orient_component(scene.block, initial_state(scene.block), all_frames(scene.block), {}, scene.tracks, bad),
      InputError);
}

}  // namespace
}  // namespace megablock
