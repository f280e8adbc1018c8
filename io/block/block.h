// The block: cameras, rigs, frames, images, priors, control. What the project file and the image headers say;
// results (poses, points) are kept apart, in BlockState.
//
// Frames of reference and conventions: docs/design.md, Conventions.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"
#include "io/base/index.h"
#include "io/base/name_table.h"

namespace megablock {

// The local topocentric ground frame (east, north, up; metres) about the block origin.
struct GroundFrame {
  bool georeferenced = false;  // false: arbitrary frame (free block or metric local coordinates)
  double latitude_deg = 0;     // of the origin, WGS84
  double longitude_deg = 0;
  double height_m = 0;        // ellipsoidal
  std::string crs = "local";  // of the inputs: "EPSG:4326", "EPSG:25832", "local"
};
bool same_origin(const GroundFrame& a, const GroundFrame& b);

struct Camera {
  std::string name;
  int width = 0, height = 0;  // pixels
  Intrinsics intrinsics{};    // start values
  // Prior sigma of each parameter in its own unit: 0 = held, infinity = free without prior.
  IntrinsicSigmas prior_sigma{};
  bool focal_known = false;  // from EXIF, sensor table or project file; else a guess (1.2 x larger side)
  std::string mask_path;     // PNG, black = ignore; empty = none
};

// Pose of a camera in its rig. A single photo is a rig of one camera with the identity mount, held.
struct Mount {
  CameraIndex camera;
  Pose pose;  // X_cam = R_mount (X_rig - C_mount)
  // Prior sigmas; 0 = held. A rig's first mount is its reference and always held.
  double rotation_sigma_rad = 0;
  double position_sigma_m = 0;
  bool held() const { return rotation_sigma_rad == 0 && position_sigma_m == 0; }
};

struct Rig {
  std::string name;
  std::vector<Mount> mounts;
};

// GNSS position of the antenna in the ground frame.
struct PositionPrior {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();   // metres
  Eigen::Vector3d sigma = Eigen::Vector3d(3, 3, 6);     // metres, east north up
  Eigen::Vector3d lever_arm = Eigen::Vector3d::Zero();  // antenna in the rig, metres: antenna = C + R' lever_arm
};

// Attitude observed in the ground frame (already turned from the frame's own vertical to the block's).
struct AttitudePrior {
  Eigen::Quaterniond rotation_cw = Eigen::Quaterniond::Identity();
  Eigen::Vector3d sigma_rad = Eigen::Vector3d::Constant(0.05);  // about the rig's x, y, z axes; see adjust/residuals.h
};

struct Frame {
  std::string name;
  RigIndex rig;
  std::int64_t pass = -1;                                    // acquisition line it belongs to, -1 unknown
  double time_s = std::numeric_limits<double>::quiet_NaN();  // of acquisition (EXIF), seconds since 1970
  std::optional<PositionPrior> position_prior;
  std::optional<AttitudePrior> attitude_prior;
  std::optional<Pose> given_pose;  // approximate pose from a file: initial orientation skips the frame
};

struct Image {
  FrameIndex frame;
  int mount = 0;                // in the frame's rig
  std::uint64_t file_hash = 0;  // XXH3 of the file (0: none)
};

// Relative pose between two frames: R = R_to R_from', T = R_from (C_to - C_from), in the from-frame's axes.
struct RelativePose {
  FrameIndex from, to;
  Pose pose;  // rotation from -> to, centre of `to` in `from`
  double rotation_sigma_rad = 0, position_sigma_m = 0;
};

struct ImageMeasurement {
  ImageIndex image;
  Eigen::Vector2d pixel;  // pixel centres at +0.5
  double sigma_px = 0.5;
};

enum class PointRole { kTie, kControl, kCheck };

struct ControlPoint {
  std::string name;
  PointRole role = PointRole::kControl;                // kControl or kCheck; a check point is adjusted as a tie point
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // ground frame, metres; z NaN = unknown height
  Eigen::Vector3d sigma = Eigen::Vector3d::Constant(0.01);  // metres
  std::vector<ImageMeasurement> measurements;
};

// A straight line of the scene with a known direction; its ends in an image are any two of its points.
struct KnownLine {
  enum class Direction : std::uint8_t { kVertical, kHorizontal };
  struct Measurement {
    ImageIndex image;
    Eigen::Vector2d first, second;  // pixel centres at +0.5
    double sigma_px = 1;            // of each end, across the line
  };
  std::string name;
  Direction direction = Direction::kVertical;
  std::vector<Measurement> measurements;
};

// Where an image sees down: by the vanishing point of vertical edges, or as an inclinometer says.
struct SeenVertical {
  ImageIndex image;
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();           // camera axes, unit
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // of `down`, radians^2, of rank two; of measuring alone
  // What `down` owes to the camera, the same error for all its images: the parameters that it was found with, and its
  // derivative by each. Empty where it owes it nothing.
  Eigen::VectorXd camera;
  Eigen::Matrix3Xd by_camera;
};

struct Block {
  GroundFrame ground;
  std::string image_folder;  // absolute, ends with '/'; empty for simulated tie points
  IndexedVector<CameraIndex, Camera> cameras;
  IndexedVector<RigIndex, Rig> rigs;
  IndexedVector<FrameIndex, Frame> frames;
  IndexedVector<ImageIndex, Image> images;
  NameTable<ImageIndex> image_names;  // [images] unique; relative paths in the image folder
  std::vector<RelativePose> relative_poses;
  std::vector<ControlPoint> control_points;
  std::vector<KnownLine> lines;
  std::vector<SeenVertical> verticals;  // ascending by image

  const Rig& rig_of(FrameIndex frame) const { return rigs[frames[frame].rig]; }
  const Mount& mount_of(ImageIndex image) const {
    return rig_of(images[image].frame).mounts[static_cast<std::size_t>(images[image].mount)];
  }
  CameraIndex camera_of(ImageIndex image) const { return mount_of(image).camera; }
  // Throw std::out_of_range where image_names is away.
  std::string name_of(ImageIndex image) const { return std::string(image_names[image]); }
  std::string path_of(ImageIndex image) const { return image_folder.empty() ? "" : image_folder + name_of(image); }

  ImageIndex add_image(std::string_view name, const Image& image) {
    image_names.push_back(name);
    images.push_back(image);
    return ImageIndex(std::ssize(images) - 1);
  }
};

// Current values of everything but points. Mounts are indexed [rig][mount].
struct BlockState {
  IndexedVector<FrameIndex, Pose> frames;
  IndexedVector<FrameIndex, std::uint8_t> oriented;  // 1 = the frame has a pose
  IndexedVector<CameraIndex, Intrinsics> cameras;
  IndexedVector<RigIndex, std::vector<Pose>> mounts;
};

// State with the block's start values: cameras and mounts as given, frames with given_pose oriented.
BlockState initial_state(const Block& block);

// Any image file that is there.
bool has_pictures(const Block& block);

// Throws InputError when indices dangle, sigmas are negative or not finite, names repeat, quaternions are not unit.
void check(const Block& block);

}  // namespace megablock
