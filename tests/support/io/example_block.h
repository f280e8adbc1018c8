// Gives small blocks that use every field, for tests of files.
#pragma once

#include <string>

#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

// Two cameras on one rig, one single camera; four frames, six images; priors of every kind on some of the frames.
inline Block example_block() {
  Block block;
  block.ground = {true, 48.123456789, 11.5, 555.25, "EPSG:25832"};
  const double infinity = std::numeric_limits<double>::infinity();
  block.cameras.push_back({"front",
                           4000,
                           3000,
                           {3000.1, 2000.5, 1500.25, -0.1, 0.01, 1e-3, 1e-4, -2e-4},
                           {10, 5, 5, infinity, infinity, 0, 1e-3, 1e-3},
                           true,
                           "masks/vorn \xc3\xa4.png",
                           0.025,
                           true,
                           true,
                           "estimated: f"});
  block.cameras.push_back({"back",
                           1920,
                           1080,
                           {*find_model("ign-radial"), {1400, 960, 540, 950, 530, -4.6e-8, 3.1e-14, 0}},
                           {},
                           false,
                           "",
                           0,
                           false,
                           false,
                           ""});
  Rig pair{"pair", {Mount{CameraIndex(0), {}, 0, 0}, Mount{CameraIndex(1), {}, 0.01, 0.002}}};
  pair.mounts[1].pose = {Eigen::Quaterniond(0, 0, 1, 0), {0.1, -0.2, 0.30000000000000004}};
  block.rigs.push_back(pair);
  block.rigs.push_back({"single", {Mount{CameraIndex(1), {}, 0, 0}}});
  for (int f = 0; f < 4; ++f) {
    Frame frame;
    frame.name = "frame " + std::to_string(f);
    frame.rig = RigIndex(f < 2 ? 0 : 1);
    block.frames.push_back(frame);
  }
  Frame& first = block.frames[FrameIndex(0)];
  first.pass = 3;
  first.time_s = 1.6e9 + 0.125;
  first.position_prior = PositionPrior{{1.1, 2.2, 3.3}, {0.1, 0.2, 0.3}, {0, 0, -1.5}};
  first.attitude_prior = AttitudePrior{Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {0.01, 0.02, 0.03}};
  block.frames[FrameIndex(2)].given_pose = Pose{Eigen::Quaterniond(0, 1, 0, 0), {7, 8, 9}};
  block.image_folder = "/data/";
  block.add_image("a/0.jpg", {FrameIndex(0), 0, 0x123456789abcdef0u});
  block.add_image("b/0.jpg", {FrameIndex(0), 1, 1});
  block.add_image("a/1.jpg", {FrameIndex(1), 0, 2});
  block.add_image("b/1.jpg", {FrameIndex(1), 1, 3});
  block.add_image("2.jpg", {FrameIndex(2), 0, 0});
  block.add_image("gr\xc3\xbcn.jpg", {FrameIndex(3), 0, 0xffffffffffffffffu});
  block.relative_poses.push_back(
      {FrameIndex(0), FrameIndex(1), {Eigen::Quaterniond(0.6, 0, 0.8, 0), {4, 0.001, -0.002}}, 1e-3, 0.05});
  ControlPoint control{"GCP 1", PointRole::kControl, {10, 20, std::nan("")}, {0.01, 0.01, 0.02}, {}};
  control.measurements = {{ImageIndex(0), {100.25, 200.5}, 0.3}, {ImageIndex(3), {7, 8}, 0.5}};
  block.control_points = {control, {"CP 1", PointRole::kCheck, {1, 2, 3}, {0.02, 0.02, 0.04}, {}}};
  const Eigen::Matrix3d across = Eigen::Vector3d(1e-6, 0, 4e-6).asDiagonal();
  block.verticals.push_back({ImageIndex(0), Eigen::Vector3d::UnitY(), across, {}, {}});
  block.verticals.push_back({ImageIndex(3), Eigen::Vector3d::UnitY(), across, Eigen::VectorXd::LinSpaced(8, 1, 2),
                             Eigen::Matrix3Xd::Constant(3, 8, 0.1)});
  return block;
}

// Three tracks over the images of example_block().
inline TrackSet example_tracks() {
  TrackSet tracks;
  tracks.id = {TrackIndex(5), TrackIndex(6), TrackIndex(100000000000)};
  tracks.begin = {0, 2, 5, 7};
  for (const int image : {0, 2, 1, 3, 5, 0, 4}) tracks.image.push_back(ImageIndex(image));
  tracks.x = {100, 200, -300, 4095999, 5, 6, 7};
  tracks.y = {1, 2, 3, 4, 3071999, -6, 7};
  tracks.feature = {0, 1, 2, 3, -1, 2147483647, 6};
  return tracks;
}

}  // namespace megablock
