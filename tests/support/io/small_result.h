// Gives a small result with everything that the exporters must tell apart: a rig of two cameras, a camera with every
// parameter but the skew, an image without orientation, points without position, rejected observations.
#pragma once

#include <cmath>
#include <random>

#include "io/result/result.h"
#include "tests/support/io/image_names.h"

namespace megablock::fixture {

inline BlockResult small_result(bool full_distortion = true) {
  BlockResult result;
  Block& block = result.block;
  block.ground = {true, 46.84, -91.99, 200, "EPSG:4979"};
  for (int c = 0; c < 2; ++c) {
    Camera camera;
    camera.name = "camera " + std::to_string(c);
    camera.width = 2000;
    camera.height = 1500;
    camera.intrinsics = {1500.0 + 20 * c, 1003.25, 747.5, -0.11, 0.05, 0, 0, 0};
    if (full_distortion && c == 1) camera.intrinsics = {1520, 1003.25, 747.5, -0.11, 0.05, 0.013, 0.0011, -0.0007, 3.5};
    block.cameras.push_back(camera);
  }
  const Pose mount{rotation_exp<double>({0.02, 0.3, -0.05}), {0.5, 0.1, -0.2}};
  block.rigs.push_back({"rig", {Mount{CameraIndex(0), {}}, Mount{CameraIndex(1), mount, 0.01, 0.01}}});
  for (int f = 0; f < 4; ++f) {
    Frame frame;
    frame.name = "frame" + std::to_string(f);
    frame.rig = RigIndex(0);
    frame.pass = f / 2;
    for (int m = 0; m < 2; ++m) block.add_image(frame.name + "/" + std::to_string(m) + ".jpg", {FrameIndex(f), m, 0});
    block.frames.push_back(frame);
  }
  result.state = initial_state(block);
  // Nadir, slightly tilted, 100 m up; the third frame has no orientation.
  const Eigen::Quaterniond nadir = rotation_from(OmegaPhiKappa{0, 0, 0.4});
  for (int f = 0; f < 4; ++f) {
    result.state.frames[FrameIndex(f)] = {rotation_update(nadir, {0.01 * f, -0.02, 0.03 * f}),
                                          {15.0 * f, 2.0 * f, 100}};
    result.state.oriented[FrameIndex(f)] = f != 2;
  }
  std::mt19937_64 engine(5);
  std::uniform_real_distribution<double> uniform(-25, 25);
  result.tracks.begin.push_back(0);
  for (int t = 0; t < 40; ++t) {
    const Eigen::Vector3d point(22 + uniform(engine), uniform(engine), 0.1 * uniform(engine));
    for (std::size_t i = 0; i < block.images.size(); ++i) {
      const ImageIndex image(static_cast<std::int64_t>(i));
      const Mount& m = block.mount_of(image);
      const Eigen::Vector2d pixel = project(block.cameras[m.camera].intrinsics,
                                            to_camera(result.state.frames[block.images[image].frame], m.pose, point));
      if (pixel.minCoeff() < 0 || pixel.x() > 2000 || pixel.y() > 1500) continue;
      result.tracks.image.push_back(image);
      result.tracks.x.push_back(to_fixed_pixel(pixel.x() + 0.01 * uniform(engine)));
      result.tracks.y.push_back(to_fixed_pixel(pixel.y() + 0.01 * uniform(engine)));
      result.tracks.feature.push_back(-1);
      result.kept.push_back(result.kept.size() % 7 != 3);
    }
    result.tracks.id.push_back(TrackIndex(3 * t + 1));
    result.tracks.begin.push_back(static_cast<std::int64_t>(result.tracks.image.size()));
    result.points.push_back(t % 9 == 4 ? Eigen::Vector3d::Constant(std::nan("")).eval() : point);
  }
  result.residual_x.assign(result.kept.size(), 0.f);
  result.residual_y.assign(result.kept.size(), 0.f);
  result.tiles.tile_count = 1;
  result.tiles.tile_of_frame.assign(4, TileIndex(0));
  result.tiles.component.assign(4, 0);
  result.boundary.assign(4, 0);
  return result;
}

// Gives every camera, rig, frame and image a name with a comma, quotes, a line break and '#' in front.
inline void name_oddly(Block& block) {
  const auto odd = [](const std::string& name) { return "# \"" + name + "\",\nand so on"; };
  for (Camera& camera : block.cameras) camera.name = odd(camera.name);
  for (Rig& rig : block.rigs) rig.name = odd(rig.name);
  for (Frame& frame : block.frames) frame.name = odd(frame.name);
  rename_images(block, [&](ImageIndex image) { return odd(block.name_of(image)); });
}

}  // namespace megablock::fixture
