#include "adjust/orientation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "geometry/similarity.h"
#include "io/error.h"
#include "io/simulate/simulate.h"

namespace megablock {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

struct PairNoise {
  double rotation_deg = 0.3, direction_deg = 3;
  double wrong_share = 0.1;  // of relative rotations
  int min_tracks = 20;
};

// Verified pairs as matching would give them: relative orientations from the truth with noise.
std::vector<VerifiedPair> pairs_of(const SimulatedBlock& simulated, const PairNoise& noise) {
  std::map<std::pair<std::int64_t, std::int64_t>, int> common;
  const TrackSet& tracks = simulated.tracks;
  for (std::size_t t = 0; t < tracks.id.size(); ++t)
    for (auto i = tracks.begin[t]; i < tracks.begin[t + 1]; ++i)
      for (auto j = i + 1; j < tracks.begin[t + 1]; ++j)
        ++common[{tracks.image[static_cast<std::size_t>(i)].value, tracks.image[static_cast<std::size_t>(j)].value}];

  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 1);
  const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
  std::vector<VerifiedPair> pairs;
  for (const auto& [key, count] : common) {
    if (count < noise.min_tracks) continue;
    VerifiedPair pair;
    pair.a = ImageIndex(key.first);
    pair.b = ImageIndex(key.second);
    const auto camera = [&](ImageIndex image) {
      const Image& i = simulated.block.images[image];
      return camera_pose(
          simulated.truth.frames[i.frame],
          simulated.truth.mounts[simulated.block.frames[i.frame].rig][static_cast<std::size_t>(i.mount)]);
    };
    const Pose a = camera(pair.a), b = camera(pair.b);
    Eigen::Quaterniond rotation = b.rotation * a.rotation.conjugate();
    const Eigen::Vector3d base = b.rotation * (a.centre - b.centre);
    rotation = rotation_update(rotation, noise.rotation_deg * kDegree * vector());
    pair.model = base.norm() > 1e-6 ? PairModel::kEssential : PairModel::kRotationOnly;
    Eigen::Vector3d t = base.norm() > 1e-6 ? base.normalized() : Eigen::Vector3d::Zero();
    if (base.norm() > 1e-6) t = rotation_exp<double>(noise.direction_deg * kDegree * vector()) * t;
    if (std::uniform_real_distribution<double>(0, 1)(random) < noise.wrong_share)
      rotation = rotation_update(rotation, 2.0 * vector());
    pair.rotation_wxyz = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
    pair.translation = {t.x(), t.y(), t.z()};
    pair.feature_a.resize(static_cast<std::size_t>(count));
    pair.feature_b.resize(static_cast<std::size_t>(count));
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

std::vector<FrameIndex> all_frames(const Block& block) {
  std::vector<FrameIndex> frames;
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) frames.push_back(f);
  return frames;
}

struct Errors {
  double position_m = 0, rotation_deg = 0;  // largest
  std::size_t oriented = 0;
};

// Against the truth, directly or after the best similarity.
Errors errors_of(const SimulatedBlock& simulated, const OrientationResult& result, bool free) {
  std::vector<Eigen::Vector3d> from, to;
  std::vector<Pose> poses, truth;
  for (FrameIndex f : all_frames(simulated.block)) {
    if (!result.state.oriented[f]) continue;
    poses.push_back(result.state.frames[f]);
    truth.push_back(simulated.truth.frames[f]);
    from.push_back(poses.back().centre);
    to.push_back(truth.back().centre);
  }
  Similarity similarity;
  if (free) similarity = fit_similarity(from, to).value();
  Errors errors;
  errors.oriented = poses.size();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose pose = similarity(poses[i]);
    errors.position_m = std::max(errors.position_m, (pose.centre - truth[i].centre).norm());
    errors.rotation_deg = std::max(errors.rotation_deg, rotation_angle(pose.rotation, truth[i].rotation) / kDegree);
  }
  return errors;
}

OrientationResult orient(const SimulatedBlock& simulated, const std::vector<VerifiedPair>& pairs) {
  return orient_component(simulated.block, initial_state(simulated.block), all_frames(simulated.block), pairs,
                          simulated.tracks, {});
}

SimulationOptions aerial(std::int64_t frames) {
  SimulationOptions options;
  options.frames = frames;
  options.start_position_error_m = options.start_rotation_error_deg = -1;
  options.outlier_share = 0.05;
  options.gps_sigma_m = 3;
  return options;
}

SimulationOptions street(std::int64_t frames) {
  SimulationOptions options = aerial(frames);
  options.scene = SimulationOptions::Scene::kStreet;
  return options;
}

TEST(Orientation, AerialBlockWithPositions) {
  const SimulatedBlock simulated = simulate_block(aerial(40));
  const auto result = orient(simulated, pairs_of(simulated, {}));
  const Errors errors = errors_of(simulated, result, false);
  EXPECT_EQ(errors.oriented, 40u);
  EXPECT_LT(errors.position_m, 6);
  EXPECT_LT(errors.rotation_deg, 3);
}

TEST(Orientation, AerialBlockWithoutPositions) {
  SimulationOptions options = aerial(40);
  options.gps_sigma_m = 0;
  const SimulatedBlock simulated = simulate_block(options);
  const auto result = orient(simulated, pairs_of(simulated, {}));
  const Errors errors = errors_of(simulated, result, true);
  EXPECT_EQ(errors.oriented, 40u);
  EXPECT_LT(errors.position_m, 3);
  EXPECT_LT(errors.rotation_deg, 1);
}

TEST(Orientation, StreetWithPositions) {
  const SimulatedBlock simulated = simulate_block(street(40));
  const auto result = orient(simulated, pairs_of(simulated, {}));
  const Errors errors = errors_of(simulated, result, false);
  EXPECT_EQ(errors.oriented, 40u);
  EXPECT_LT(errors.position_m, 3);
  EXPECT_LT(errors.rotation_deg, 3);
}

TEST(Orientation, StreetOfOneCameraWithoutPositions) {
  SimulationOptions options = street(40);
  options.rig_cameras = 1;
  options.gps_sigma_m = 0;
  const SimulatedBlock simulated = simulate_block(options);
  const auto result = orient(simulated, pairs_of(simulated, {}));
  const Errors errors = errors_of(simulated, result, true);
  EXPECT_EQ(errors.oriented, 40u);
  EXPECT_LT(errors.position_m, 1.5);
  EXPECT_LT(errors.rotation_deg, 1);
}

}  // namespace
}  // namespace megablock
