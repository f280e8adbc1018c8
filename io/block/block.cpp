// Every block passes check() before a stage sees it: from a project file, from an import or from the simulator. The
// stages rely on what it tests.
#include "io/block/block.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <unordered_set>

#include "geometry/camera/camera.h"
#include "io/base/error.h"

namespace megablock {

BlockState initial_state(const Block& block) {
  BlockState state;
  state.frames.resize(block.frames.size());
  state.oriented.assign(block.frames.size(), 0);
  for (std::size_t f = 0; f < block.frames.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    if (!block.frames[frame].given_pose) continue;
    state.frames[frame] = *block.frames[frame].given_pose;
    state.oriented[frame] = 1;
  }
  for (const Camera& camera : block.cameras) state.cameras.push_back(camera.intrinsics);
  for (const Rig& rig : block.rigs) {
    std::vector<Pose> poses;
    for (const Mount& mount : rig.mounts) poses.push_back(mount.pose);
    state.mounts.push_back(std::move(poses));
  }
  return state;
}

namespace {

void require(bool condition, const std::string& message) {
  if (!condition) throw InputError(message);
}

void check_unit(const Pose& pose, const std::string& what) {
  require(std::abs(pose.rotation.norm() - 1) < 1e-9,
          what + ": rotation is not a unit quaternion; leave the pose out or correct it");
  require(pose.centre.allFinite(), what + ": position is not finite; leave the pose out or correct it");
}

void check_names(const auto& items, const std::string& kind) {
  std::unordered_set<std::string> seen;
  for (const auto& item : items)
    require(seen.insert(item.name).second, kind + " '" + item.name + "' appears twice; names must differ");
}

void check_image_names(const Block& block) {
  require(block.image_names.size() == block.images.size(), std::to_string(block.images.size()) + " images have " +
                                                               std::to_string(block.image_names.size()) +
                                                               " names; the file of the block is damaged");
  // Names usually arrive in order; then neighbours alone must differ.
  bool ascending = true;
  for (ImageIndex i(1); block.images.contains(i) && ascending; ++i.value)
    ascending = block.image_names[ImageIndex(i.value - 1)] < block.image_names[i];
  if (ascending) return;  // the usual case; the list below takes 16 bytes for each image
  std::vector<std::string_view> names;
  names.reserve(block.images.size());
  for (ImageIndex i(0); block.images.contains(i); ++i.value) names.push_back(block.image_names[i]);
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  require(twice == names.end(),
          twice == names.end() ? "" : "image '" + std::string(*twice) + "' appears twice; names must differ");
}

bool positive(const Eigen::Vector3d& sigma) { return (sigma.array() > 0).all(); }

void check_verticals(const Block& block) {
  ImageIndex before;
  for (const SeenVertical& vertical : block.verticals) {
    require(block.images.contains(vertical.image), "a vertical refers to an image that the block does not have");
    const std::string what = "vertical of image '" + block.name_of(vertical.image) + "'";
    require(before < vertical.image, what + ": appears twice, or out of the order of images");
    before = vertical.image;
    require(std::abs(vertical.down.norm() - 1) < 1e-6, what + ": is not a unit vector");
    // A unit vector has no error along itself, so only the covariance across it must be positive.
    const Eigen::Matrix<double, 3, 2> plane = tangent_plane(vertical.down);
    const Eigen::Matrix2d covariance = plane.transpose() * vertical.covariance * plane;
    require(covariance.allFinite() && covariance(0, 0) > 0 && covariance.determinant() > 0,
            what + ": its covariance is not positive; sigmas must be greater than 0");
    require(vertical.camera.size() == vertical.by_camera.cols() && vertical.camera.allFinite() &&
                vertical.by_camera.allFinite(),
            what + ": it must have a finite derivative for each parameter of its camera");
    require(vertical.camera.size() == 0 ||
                vertical.camera.size() == block.cameras[block.camera_of(vertical.image)].intrinsics.size(),
            what + ": was found with another camera model; determine it again");
  }
}

}  // namespace

bool same_origin(const GroundFrame& a, const GroundFrame& b) {
  // Exactly: origins are copied, not computed.
  return a.latitude_deg == b.latitude_deg && a.longitude_deg == b.longitude_deg && a.height_m == b.height_m;
}

bool has_image_files(const Block& block) {
  for (ImageIndex i(0); block.images.contains(i); ++i.value)
    if (const std::string path = block.path_of(i); !path.empty() && std::filesystem::exists(path)) return true;
  return false;
}

void check(const Block& block) {
  check_names(block.cameras, "camera");
  check_image_names(block);
  check_names(block.control_points, "control point");
  check_names(block.lines, "line");
  for (const Camera& camera : block.cameras) {
    require(camera.width > 0 && camera.height > 0, "camera '" + camera.name + "': width and height must be positive");
    require(camera.intrinsics[kFocal] > 0, "camera '" + camera.name + "': focal length must be positive (pixels)");
    require(std::all_of(camera.intrinsics.begin(), camera.intrinsics.end(), [](double v) { return std::isfinite(v); }),
            "camera '" + camera.name + "': a parameter is not a finite number");
    require(std::abs(camera.readout_s) <= kLongestReadoutS,
            "camera '" + camera.name + "': the readout time of an image must be at most 1 s");
    for (double sigma : camera.prior_sigma)
      // Infinity is allowed and means a free parameter; the comparison also refuses NaN.
      require(sigma >= 0, "camera '" + camera.name + "': a prior sigma is negative or not a number");
  }
  for (const Rig& rig : block.rigs) {
    require(!rig.mounts.empty(), "rig '" + rig.name + "': has no camera");
    require(rig.is_group() || rig.mounts.front().held(),
            "rig '" + rig.name + "': its first mount is the reference and must be held");
    for (const Mount& mount : rig.cameras()) {
      require(block.cameras.contains(mount.camera),
              "rig '" + rig.name + "': a mount refers to a camera that the block does not have");
      check_unit(mount.pose, "rig '" + rig.name + "'");
      require(mount.held() || (mount.rotation_sigma_rad > 0 && mount.position_sigma_m > 0),
              "rig '" + rig.name + "': the sigmas of a mount must be both positive, or both 0 to hold it");
    }
    if (!rig.has_receiver()) continue;
    const Mount& receiver = rig.mounts.back();
    check_unit(receiver.pose, "receiver of rig '" + rig.name + "'");
    require(receiver.rotation_sigma_rad >= 0 && receiver.position_sigma_m >= 0,
            "rig '" + rig.name + "': the sigmas of a receiver must be at least 0");
  }
  for (const Frame& frame : block.frames) {
    require(block.rigs.contains(frame.rig) && !block.rigs[frame.rig].is_group(),
            "frame '" + frame.name + "': refers to a rig that the block does not have");
    if (frame.position_prior && frame.position_prior->group.valid())
      require(block.rigs.contains(frame.position_prior->group) && block.rigs[frame.position_prior->group].is_group(),
              "frame '" + frame.name + "': its position belongs to a group that the block does not have");
    if (frame.position_prior)
      require(frame.position_prior->position.allFinite() && frame.position_prior->lever_arm.allFinite() &&
                  positive(frame.position_prior->sigma),
              "frame '" + frame.name + "': position prior must be finite with positive sigmas (metres)");
    if (frame.attitude_prior)
      require(
          positive(frame.attitude_prior->sigma_rad) && std::abs(frame.attitude_prior->rotation_cw.norm() - 1) < 1e-9,
          "frame '" + frame.name + "': attitude prior must be a unit quaternion with positive sigmas");
    if (frame.given_pose) check_unit(*frame.given_pose, "frame '" + frame.name + "'");
  }
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    const Image& image = block.images[i];
    require(block.frames.contains(image.frame),
            "image '" + block.name_of(i) + "': refers to a frame that the block does not have");
    require(image.mount >= 0 && image.mount < std::ssize(block.rig_of(image.frame).cameras()),
            "image '" + block.name_of(i) + "': its rig has no such mount");
  }
  for (const RelativePose& relative : block.relative_poses) {
    require(block.frames.contains(relative.from) && block.frames.contains(relative.to),
            "a relative pose refers to a frame that the block does not have");
    const std::string what = "relative pose of frames '" + block.frames[relative.from].name + "' and '" +
                             block.frames[relative.to].name + "'";
    require(relative.rotation_sigma_rad > 0 && relative.position_sigma_m > 0, what + " has no positive sigmas");
    check_unit(relative.pose, what);
  }
  for (const auto& [key, measurements] : block.frame_measurements)
    for (const FrameMeasurement& m : measurements) {
      require(block.frames.contains(m.from) && block.frames.contains(m.to),
              key + ": a row names no frame of the block");
      const std::string what =
          key + ": row of frames '" + block.frames[m.from].name + "' and '" + block.frames[m.to].name + "'";
      require(m.from != m.to, what + " is of one frame");
      require(std::isfinite(m.value) && std::isfinite(m.sigma) && m.sigma > 0, what + " has no finite positive sigma");
    }
  for (const ControlPoint& point : block.control_points) {
    require(positive(point.sigma), "control point '" + point.name + "': sigmas must be positive (metres)");
    require(point.position.head<2>().allFinite() && !std::isinf(point.position.z()),
            "control point '" + point.name + "': position must be finite (metres; height may be unknown)");
    for (const ImageMeasurement& m : point.measurements) {
      require(block.images.contains(m.image),
              "control point '" + point.name + "': an observation refers to an image that the block does not have");
      require(m.pixel.allFinite() && m.sigma_px > 0,
              "control point '" + point.name + "': an image measurement is not finite, or its sigma is not positive");
    }
  }
  for (const KnownLine& line : block.lines)
    for (const KnownLine::Measurement& m : line.measurements) {
      require(block.images.contains(m.image),
              "line '" + line.name + "': an observation refers to an image that the block does not have");
      require(m.first.allFinite() && m.second.allFinite() && m.first != m.second && m.sigma_px > 0,
              "line '" + line.name +
                  "': an image measurement is not finite, has no extent, or has a sigma that is not positive");
    }
  check_verticals(block);
}

}  // namespace megablock
