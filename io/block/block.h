// Holds the block: cameras, rigs, frames, images, priors and control, as read from the project file and the image
// headers. Results (poses, points) are kept separately, in BlockState.
//
// docs/developer/mathematics.md, "Conventions", defines the frames and the sense of rotations.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"
#include "io/base/index.h"
#include "io/base/name_table.h"

namespace megablock {

// The local topocentric ground frame (east, north, up; metres) about the origin of the block.
struct GroundFrame {
  bool georeferenced = false;  // false: arbitrary frame (free block, or metric local coordinates)
  double latitude_deg = 0;     // of the origin, WGS84, degrees
  double longitude_deg = 0;
  double height_m = 0;        // above the ellipsoid
  std::string crs = "local";  // of the input: "EPSG:4326", "EPSG:25832", "local"
};
bool same_origin(const GroundFrame& a, const GroundFrame& b);

struct Camera {
  std::string name;
  int width = 0, height = 0;  // pixels
  Intrinsics intrinsics{};    // initial values
  // Prior standard deviation of each parameter in its own unit: 0 = held fixed, infinity = free without a prior.
  IntrinsicSigmas prior_sigma{};
  // From EXIF, the sensor table or the project file; false: a guess (1.2 times the larger side).
  bool focal_known = false;
  std::string mask_path;  // PNG, black = ignore; empty = no mask
  // Time from the first row of an image to the last, seconds; 0: all rows are exposed at once, negative: the last row
  // comes first (geometry/camera/rolling_shutter.h).
  double readout_s = 0;
  bool estimate_readout = false;  // the images tell it, and must confirm what is given, unless that is 0
  // Whether the block decides which parameters are estimated, and what it decided, for the report.
  bool choose = false;
  std::string choice;
};

inline constexpr double kLongestReadoutS = 1;  // of Camera::readout_s

// Pose of a camera in its rig. A single camera is a rig of one camera with the identity as its mount, held fixed.
struct Mount {
  CameraIndex camera;  // invalid: the receiver of the rig (observed_poses.h)
  Pose pose;           // X_cam = R_mount (X_rig - C_mount)
  // Prior standard deviations; 0 = held fixed. The first mount of a rig is its reference and always held.
  double rotation_sigma_rad = 0;
  double position_sigma_m = 0;
  bool held() const { return rotation_sigma_rad == 0 && position_sigma_m == 0; }
};

// Cameras that are fixed to each other, and the receiver that observes their positions and attitudes. A rig without
// cameras is a group of positions with a shift of their own (observed_poses.h).
struct Rig {
  std::string name;
  std::vector<Mount> mounts;  // of the cameras, then of the receiver, where it is no part of the priors
  bool has_receiver() const { return !mounts.empty() && !mounts.back().camera.valid(); }
  bool is_group() const { return mounts.size() == 1 && has_receiver(); }
  std::span<const Mount> cameras() const { return {mounts.data(), mounts.size() - (has_receiver() ? 1 : 0)}; }
};

// East, north, up. 1: the positions of a group are shifted along this axis.
using ShiftAxes = Eigen::Matrix<std::uint8_t, 3, 1>;

// Position of the GNSS antenna in the ground frame.
struct PositionPrior {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // metres
  Eigen::Vector3d sigma = Eigen::Vector3d(3, 3, 6);    // metres; east, north, up
  // Position of the antenna in the rig, metres: antenna = C + R' lever_arm.
  Eigen::Vector3d lever_arm = Eigen::Vector3d::Zero();
  RigIndex group{};  // whose shift the position has; invalid: none
  ShiftAxes shifted{0, 0, 0};
};

// Attitude observed in the ground frame. Where it was observed relative to the vertical at the frame's own place, it
// has been turned to the vertical of the block's origin.
struct AttitudePrior {
  Eigen::Quaterniond rotation_cw = Eigen::Quaterniond::Identity();
  Eigen::Vector3d sigma_rad = Eigen::Vector3d::Constant(0.05);  // about the rig's x, y, z axes
};

// One exposure of a rig, with what is known of its pose.
struct Frame {
  std::string name;
  RigIndex rig;
  std::int64_t pass = -1;                                    // number of the acquisition line; -1: unknown
  double time_s = std::numeric_limits<double>::quiet_NaN();  // of acquisition (EXIF), seconds since 1970
  std::optional<PositionPrior> position_prior;
  std::optional<AttitudePrior> attitude_prior;
  std::optional<Pose> given_pose;  // approximate pose from a file; initial orientation skips this frame
};

// One exposure of one camera.
struct Image {
  FrameIndex frame;
  int mount = 0;                // index in the mounts of the frame's rig
  std::uint64_t file_hash = 0;  // XXH3 of the file; 0: none
};

// Observed relative pose of two frames, in the axes of `from`: R = R_to R_from', T = R_from (C_to - C_from).
struct RelativePose {
  FrameIndex from, to;
  Pose pose;  // rotation from -> to, centre of `to` in `from`
  double rotation_sigma_rad = 0, position_sigma_m = 0;
};

// A number measured between two frames. Its type says which (frame_measurements.h).
struct FrameMeasurement {
  FrameIndex from, to;
  double value = 0, sigma = 0;  // in the unit of the type
};

// The observation of a point in an image.
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

// A straight line of the scene with a known direction. Its end points in an image are any two points of it.
struct KnownLine {
  enum class Direction : std::uint8_t { kVertical, kHorizontal };
  struct Measurement {
    ImageIndex image;
    Eigen::Vector2d first, second;  // pixel centres at +0.5
    double sigma_px = 1;            // of each end point, across the line
  };
  std::string name;
  Direction direction = Direction::kVertical;
  std::vector<Measurement> measurements;
};

// The vertical as an image sees it, from the vanishing point of vertical edges or from an inclinometer.
struct SeenVertical {
  ImageIndex image;
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();  // camera axes, unit vector
  // Covariance of `down` from its measurement alone, rad^2, rank two.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  // The dependence of `down` on the camera, whose errors are common to all its images: the parameters used to find it,
  // and its derivative by each of them. Empty for a vertical that does not depend on the camera.
  Eigen::VectorXd camera;
  Eigen::Matrix3Xd by_camera;
};

// All observations and priors of a block.
struct Block {
  GroundFrame ground;
  std::string image_folder;  // absolute, ends with '/'; empty for simulated tie points
  IndexedVector<CameraIndex, Camera> cameras;
  IndexedVector<RigIndex, Rig> rigs;
  IndexedVector<FrameIndex, Frame> frames;
  IndexedVector<ImageIndex, Image> images;
  NameTable<ImageIndex> image_names;  // [images] relative paths in the image folder, all different
  std::vector<RelativePose> relative_poses;
  std::vector<ControlPoint> control_points;
  std::vector<KnownLine> lines;
  std::vector<SeenVertical> verticals;                                      // ascending by image
  std::map<std::string, std::vector<FrameMeasurement>> frame_measurements;  // by the key of their type

  const Rig& rig_of(FrameIndex frame) const { return rigs[frames[frame].rig]; }
  const Mount& mount_of(ImageIndex image) const {
    return rig_of(images[image].frame).mounts[static_cast<std::size_t>(images[image].mount)];
  }
  CameraIndex camera_of(ImageIndex image) const { return mount_of(image).camera; }
  // These two throw std::out_of_range if image_names is unloaded.
  std::string name_of(ImageIndex image) const { return std::string(image_names[image]); }
  std::string path_of(ImageIndex image) const { return image_folder.empty() ? "" : image_folder + name_of(image); }

  ImageIndex add_image(std::string_view name, const Image& image) {
    image_names.push_back(name);
    images.push_back(image);
    return ImageIndex(std::ssize(images) - 1);
  }
};

// The current values of all unknowns except points. Mounts are indexed [rig][mount].
struct BlockState {
  IndexedVector<FrameIndex, Pose> frames;
  IndexedVector<FrameIndex, std::uint8_t> oriented;  // 1 = the frame has a pose
  IndexedVector<CameraIndex, Intrinsics> cameras;
  IndexedVector<RigIndex, std::vector<Pose>> mounts;
};

// The state with the initial values of the block: cameras and mounts as given; frames with a given pose are oriented.
BlockState initial_state(const Block& block);

// Whether at least one image file exists.
bool has_image_files(const Block& block);

// Throws InputError for indices that refer to nothing, sigmas that are negative or not finite, repeated names, and
// quaternions that are not unit quaternions.
void check(const Block& block);

}  // namespace megablock
