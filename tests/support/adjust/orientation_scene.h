// Simulates small scenes with known truth for the tests of initial orientation: single cameras, points, and matches
// with noise, wrong tracks and wrong relative rotations.
#pragma once

#include <cmath>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "adjust/orientation/orientation.h"
#include "geometry/numbers/angles.h"
#include "geometry/similarity/similarity.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock::orientation_scene {

struct SceneOptions {
  double noise_px = 0.5;
  double wrong_tracks = 0.1;  // share of tracks with one observation anywhere in the image
  double focal_px = 1200;
  double focal_guess = 1;       // times the true focal length; unless 1 the block says that it is a guess
  double gps_sigma_m = 0;       // <= 0: none
  double max_distance_m = 1e9;  // points farther away are not seen
  unsigned seed = 1;
};

inline Eigen::Quaterniond looking(const Eigen::Vector3d& forward, const Eigen::Vector3d& down) {
  Eigen::Matrix3d rotation;
  const Eigen::Vector3d z = forward.normalized(), x = down.cross(z).normalized();
  rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  return Eigen::Quaterniond(rotation).normalized();
}

inline Eigen::Vector3d normal_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal(0, 1);
  const double x = normal(random), y = normal(random), z = normal(random);
  return {x, y, z};
}

inline SimulatedBlock make_scene(const std::vector<Pose>& poses, const std::vector<Eigen::Vector3d>& points,
                                 const SceneOptions& options) {
  SimulatedBlock scene;
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal(0, options.noise_px);
  Camera camera;
  camera.name = "camera";
  camera.width = 1500;
  camera.height = 1000;
  camera.intrinsics = {options.focal_px, 750, 500, 0, 0, 0, 0, 0};
  const Intrinsics truth = camera.intrinsics;
  camera.intrinsics[kFocal] *= options.focal_guess;
  camera.focal_known = options.focal_guess == 1;
  if (!camera.focal_known) camera.prior_sigma[kFocal] = std::numeric_limits<double>::infinity();
  scene.block.cameras.push_back(camera);
  scene.block.rigs.push_back({"single", {Mount{CameraIndex(0), {}, 0, 0}}});
  for (std::size_t i = 0; i < poses.size(); ++i) {
    Frame frame;
    frame.name = "frame" + std::to_string(1000 + i);
    frame.rig = RigIndex(0);
    if (options.gps_sigma_m > 0) {
      frame.position_prior.emplace();
      frame.position_prior->sigma.setConstant(options.gps_sigma_m);
      frame.position_prior->position = poses[i].centre + options.gps_sigma_m * normal_vector(random);
    }
    scene.block.frames.push_back(frame);
    scene.block.add_image("image" + std::to_string(1000 + i), {FrameIndex(static_cast<std::int64_t>(i)), 0, 0});
  }
  scene.truth = initial_state(scene.block);
  scene.truth.frames = IndexedVector<FrameIndex, Pose>(poses);
  scene.truth.cameras[CameraIndex(0)] = truth;

  scene.tracks.begin = {0};
  for (const Eigen::Vector3d& point : points) {
    std::vector<std::pair<std::int64_t, Eigen::Vector2d>> seen;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Vector3d inside = to_inside(poses[i], point);
      if (inside.z() < 0.5 || inside.norm() > options.max_distance_m) continue;
      const Eigen::Vector2d pixel = project(truth, inside);
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > camera.width || pixel.y() > camera.height) continue;
      seen.emplace_back(static_cast<std::int64_t>(i), pixel + Eigen::Vector2d(normal(random), normal(random)));
    }
    if (seen.size() < 2) continue;
    if (uniform(random) < options.wrong_tracks)
      seen[random() % seen.size()].second = {uniform(random) * camera.width, uniform(random) * camera.height};
    scene.tracks.id.push_back(TrackIndex(scene.tracks.track_count()));
    for (const auto& [image, pixel] : seen) {
      scene.tracks.image.push_back(ImageIndex(image));
      scene.tracks.x.push_back(to_fixed_pixel(pixel.x()));
      scene.tracks.y.push_back(to_fixed_pixel(pixel.y()));
      scene.tracks.feature.push_back(-1);
    }
    scene.tracks.begin.push_back(scene.tracks.observation_count());
    scene.points.push_back(point);
  }
  return scene;
}

struct PairNoise {
  double rotation_deg = 0.3, direction_deg = 3;
  double wrong_share = 0.1;  // of relative rotations
  int min_tracks = 20;
};

// Verified pairs as matching would give them: relative orientations from the truth with noise.
inline std::vector<VerifiedPair> pairs_of(const SimulatedBlock& scene, const PairNoise& noise = {}) {
  std::map<std::pair<std::int64_t, std::int64_t>, int> common;
  const TrackSet& tracks = scene.tracks;
  for (std::size_t t = 0; t < tracks.id.size(); ++t)
    for (auto i = tracks.begin[t]; i < tracks.begin[t + 1]; ++i)
      for (auto j = i + 1; j < tracks.begin[t + 1]; ++j)
        ++common[{tracks.image[static_cast<std::size_t>(i)].value, tracks.image[static_cast<std::size_t>(j)].value}];

  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<VerifiedPair> pairs;
  for (const auto& [key, count] : common) {
    if (count < noise.min_tracks) continue;
    VerifiedPair pair;
    pair.a = ImageIndex(key.first);
    pair.b = ImageIndex(key.second);
    const auto camera = [&](ImageIndex image) {
      const Image& i = scene.block.images[image];
      const auto& mounts = scene.truth.mounts[scene.block.frames[i.frame].rig];
      return camera_pose(scene.truth.frames[i.frame], mounts[static_cast<std::size_t>(i.mount)]);
    };
    const Pose a = camera(pair.a), b = camera(pair.b);
    const Eigen::Vector3d base = b.rotation * (a.centre - b.centre);
    Eigen::Quaterniond rotation = b.rotation * a.rotation.conjugate();
    rotation = rotation_update(rotation, noise.rotation_deg * kDegree * normal_vector(random));
    Eigen::Vector3d t = rotation_exp<double>(noise.direction_deg * kDegree * normal_vector(random)) * base.normalized();
    pair.model = PairModel::kEssential;
    if (base.norm() < 1e-6) {
      t.setZero();
      pair.model = PairModel::kRotationOnly;
    }
    if (uniform(random) < noise.wrong_share) rotation = rotation_update(rotation, 2.0 * normal_vector(random));
    pair.rotation_wxyz = {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
    pair.translation = {t.x(), t.y(), t.z()};
    pair.feature_a.resize(static_cast<std::size_t>(count));
    pair.feature_b.resize(static_cast<std::size_t>(count));
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

inline std::vector<FrameIndex> all_frames(const Block& block) {
  std::vector<FrameIndex> frames;
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) frames.push_back(f);
  return frames;
}

inline OrientationResult orient(const SimulatedBlock& scene, const std::vector<VerifiedPair>& pairs) {
  return orient_component(scene.block, initial_state(scene.block), all_frames(scene.block), pairs, scene.tracks, {});
}

struct Errors {
  double position_m = 0, rotation_deg = 0;  // largest
  std::size_t oriented = 0;
};

// Against the truth, directly or after the best similarity.
inline Errors errors_of(const SimulatedBlock& scene, const OrientationResult& result, bool free) {
  std::vector<Eigen::Vector3d> from, to;
  std::vector<Pose> poses, truth;
  for (FrameIndex f : all_frames(scene.block)) {
    if (!result.state.oriented[f]) continue;
    poses.push_back(result.state.frames[f]);
    truth.push_back(scene.truth.frames[f]);
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

// Mean angle between where the images see down and where they should, degrees.
inline double off_level_deg(const SimulatedBlock& scene, const OrientationResult& result) {
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitZ();
  double sum = 0;
  for (FrameIndex f(0); scene.block.frames.contains(f); ++f.value)
    sum += (result.state.frames[f].rotation * down - scene.truth.frames[f].rotation * down).norm() / kDegree;
  return sum / static_cast<double>(scene.block.frames.size());
}

}  // namespace megablock::orientation_scene
