// Makes a plausible result, for tests of the readers of results: a simulated block with its truth as state, tiles in
// strips, noisy residuals, and sigmas. Nothing in it was adjusted.
#pragma once

#include <cmath>
#include <random>

#include "io/result/result.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {

inline SimulationOptions small_block() {
  SimulationOptions options;
  options.frames = 60;
  options.control_points = 4;
  options.check_points = 5;
  options.attitude_sigma_deg = 1;
  return options;
}

inline void add_made_up_observations(BlockResult& result, std::mt19937& random) {
  std::normal_distribution<float> noise(0, 0.4f);
  const std::size_t rows = result.tracks.image.size();
  result.kept.assign(rows, 1);
  for (std::size_t o = 0; o < rows; ++o) {
    const ImageIndex image = result.tracks.image[o];
    const Camera& camera = result.block.cameras[result.block.camera_of(image)];
    const double x = from_fixed_pixel(result.tracks.x[o]) / camera.width - 0.5;
    const double y = from_fixed_pixel(result.tracks.y[o]) / camera.height - 0.5;
    const double radial = 1.2 * (x * x + y * y) - 0.15;  // what a missing distortion parameter would leave
    result.residual_x.push_back(noise(random) + static_cast<float>(radial * x));
    result.residual_y.push_back(noise(random) + static_cast<float>(radial * y));
    if (random() % 60 == 0) result.kept[o] = 0;
    if (!result.state.oriented[result.block.images[image].frame]) {
      result.kept[o] = 0;
      result.residual_x[o] = result.residual_y[o] = std::nanf("");
    }
  }
}

inline void add_made_up_tiles(BlockResult& result, std::int64_t tiles) {
  double low = 1e300, high = -1e300;
  for (const Pose& pose : result.state.frames) {
    low = std::min(low, pose.centre.x());
    high = std::max(high, pose.centre.x());
  }
  result.tiles.tile_count = tiles;
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
    const double place = (result.state.frames[f].centre.x() - low) / (high - low + 1e-9) * static_cast<double>(tiles);
    const auto tile = static_cast<std::int64_t>(place);
    const bool known = result.state.oriented[f];
    result.tiles.tile_of_frame.push_back(known ? TileIndex(tile) : TileIndex());
    result.tiles.component.push_back(known ? 0 : -1);
    result.boundary.push_back(known && tile > 0 && place - static_cast<double>(tile) < 0.25);
  }
  for (std::int64_t t = 0; t < tiles; ++t) {
    MergeTree::Node leaf;
    leaf.tile = TileIndex(t);
    result.tiles.tree.nodes.push_back(leaf);
  }
}

inline BlockResult made_up_result(const SimulationOptions& options, std::int64_t tiles = 4) {
  SimulatedBlock simulated = simulate_block(options);
  std::mt19937 random(1);
  BlockResult result;
  result.block = std::move(simulated.block);
  result.state = std::move(simulated.truth);
  result.tracks = std::move(simulated.tracks);
  result.points = std::move(simulated.points);
  result.state.oriented.assign(result.block.frames.size(), 1);
  result.state.oriented[FrameIndex(3)] = 0;
  add_made_up_tiles(result, tiles);
  add_made_up_observations(result, random);
  for (std::size_t f = 0; f < result.block.frames.size(); ++f) {
    BlockResult::Matrix6 c = BlockResult::Matrix6::Identity() * 1e-8;
    for (int k = 3; k < 6; ++k) c(k, k) = 1e-4 * (1 + 0.1 * static_cast<double>(random() % 100)) * (k == 5 ? 3 : 1);
    result.frame_covariance.push_back(c);
  }
  for (std::size_t c = 0; c < result.block.cameras.size(); ++c) {
    const int parameters = result.block.cameras[CameraIndex(static_cast<std::int64_t>(c))].intrinsics.size();
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(parameters, parameters) * 1e-10;
    covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * 0.04;
    covariance(3, 4) = covariance(4, 3) = -0.9e-10;
    result.camera_covariance.push_back(covariance);
  }
  for (const Rig& rig : result.block.rigs) {
    std::vector<BlockResult::Matrix6> covariances(rig.mounts.size(), BlockResult::Matrix6::Zero());
    for (std::size_t m = 0; m < rig.mounts.size(); ++m)
      if (!rig.mounts[m].held())
        covariances[m].diagonal() << 1e-8, 4e-8, 9e-8, 1e-6, 4e-6, 9e-6;  // 0.0057 to 0.017 degrees, 1 to 3 mm
    result.mount_covariance.push_back(std::move(covariances));
  }
  result.point_covariance.assign(result.points.size(), Eigen::Matrix3d::Identity() * 4e-4);
  std::normal_distribution<double> noise(0, 0.012);
  for (const ControlPoint& point : result.block.control_points) {
    BlockResult::ControlResult control;
    control.adjusted = point.position + Eigen::Vector3d(noise(random), noise(random), 2 * noise(random));
    control.covariance = Eigen::Matrix3d::Identity() * 1e-4;
    for (std::size_t m = 0; m < point.measurements.size(); ++m) control.residual_px.emplace_back(0.3, -0.2);
    result.control.push_back(std::move(control));
  }
  result.variance_factor = 1.07;
  result.degrees_of_freedom = 2 * result.tracks.observation_count() - 3 * result.tracks.track_count();
  result.chi2 = result.variance_factor * static_cast<double>(result.degrees_of_freedom);
  result.global_iterations = 4;
  result.newton_decrement = 3.1e-4;
  result.decrement_limit = 1e-2;
  for (std::size_t i = 0; i < result.block.images.size(); ++i)
    result.image_records.push_back({1920, 1280, 8000 + static_cast<std::int64_t>(i), 12, 3400});
  result.provenance = {"block.yaml",
                       "megablock 0.1.0",
                       "avx2",
                       {{"matching.ratio", "0.8", "0.85"}, {"merge.decrement", "0.01", "0.01"}}};
  result.gauge = "fixed by priors";
  result.seams = {{4, 31.2, 40, 81.4, ""}, {5, 96.0, 44, 87.1, "tile 2 disagrees with its neighbours"}};
  result.failures = {{"features", "IMG_0003.jpg", "truncated JPEG: 1 024 of 48 211 bytes can be read"}};
  result.stages = {{"features", 61.4, 1210, 3, 1},
                   {"matches", 118.2, 640, 12, 0},
                   {"tracks", 1.9, 210, 4, 0},
                   {"adjust", 22.4, 380, 4, 0},
                   {"merge", 6.1, 300, 7, 0}};
  result.notes = {"1 GNSS position lies 10.2 km off its acquisition neighbours: IMG_0044.jpg"};
  result.digest = "9f3b6c1d20a87e55";
  return result;
}

}  // namespace megablock
