// The network has cameras in the ground frame, without rigs: the pose of a camera is that of its frame times that of
// its mount, and frame_pose() goes back with
//
//     R_frame = R_mount' R_camera,   C_frame = C_camera - R_frame' C_mount.
//
// Coordinates are those of a camera without distortion at the focal length f, (x, y) f / z of the viewing ray.
#include "adjust/coplanarity/coplanarity_block.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/base/error.h"

namespace megablock {

namespace {

// The poses of frames whose position and attitude are known.
using KnownPoses = IndexedVector<FrameIndex, std::optional<Pose>>;
KnownPoses known_poses(const Block& block, const BlockState& start) {
  KnownPoses poses(block.frames.size());
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    const Frame& frame = block.frames[f];
    if (!start.oriented[f] && !(frame.position_prior && frame.attitude_prior)) continue;
    Pose pose = start.frames[f];
    if (frame.attitude_prior) pose.rotation = frame.attitude_prior->rotation_cw;
    if (frame.position_prior)
      pose.centre = frame.position_prior->position - pose.rotation.conjugate() * frame.position_prior->lever_arm;
    poses[f] = pose;
  }
  return poses;
}

// The mount of the single image of every frame.
IndexedVector<FrameIndex, const Mount*> single_mounts(const Block& block) {
  IndexedVector<FrameIndex, const Mount*> mounts(block.frames.size(), nullptr);
  for (ImageIndex i(0); block.images.contains(i); ++i.value) {
    const FrameIndex frame = block.images[i].frame;
    if (mounts[frame])
      throw InputError(
          "coplanarity: frame '" + block.frames[frame].name +
          "' has several images; the determinant method takes single cameras only; use 'megablock run' for rigs");
    mounts[frame] = &block.mount_of(i);
  }
  return mounts;
}

// Adds the points that two or more frames of known pose see. A camera is the index of a frame at first.
void add_points(const Block& block, const KnownPoses& poses, const TrackSet& tracks, CoplanarityBlock& result) {
  CoplanarityNetwork& network = result.network;
  for (std::size_t t = 0; t < tracks.id.size(); ++t) {
    for (auto o = static_cast<std::size_t>(tracks.begin[t]); o < static_cast<std::size_t>(tracks.begin[t + 1]); ++o) {
      const ImageIndex image = tracks.image[o];
      const FrameIndex frame = block.images[image].frame;
      if (!poses[frame]) continue;
      const auto at = unproject(block.cameras[block.camera_of(image)].intrinsics,
                                {from_fixed_pixel(tracks.x[o]), from_fixed_pixel(tracks.y[o])});
      if (!at) continue;
      network.camera.push_back(static_cast<std::int32_t>(frame.value));
      network.image.emplace_back(network.focal_px * *at);
    }
    if (std::ssize(network.camera) - network.begin.back() >= 2) {
      network.begin.push_back(std::ssize(network.camera));
    } else {
      network.camera.resize(static_cast<std::size_t>(network.begin.back()));
      network.image.resize(network.camera.size());
      ++result.points_left_out;
    }
  }
}

// Numbers the frames that see points, and fills in their positions and attitudes.
void add_cameras(const Block& block, const KnownPoses& poses, CoplanarityBlock& result) {
  CoplanarityNetwork& network = result.network;
  std::vector<std::int32_t> number(block.frames.size(), -1);
  // Only frames that see a point of the network become cameras: any other would be an open direction of the system.
  for (const std::int32_t frame : network.camera) number[static_cast<std::size_t>(frame)] = 0;
  const IndexedVector<FrameIndex, const Mount*> mounts = single_mounts(block);
  double squares = 0, attitudes = 0;
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    std::int32_t& own = number[static_cast<std::size_t>(f.value)];
    if (own < 0) {
      ++result.frames_left_out;
      continue;
    }
    own = static_cast<std::int32_t>(result.frames.size());
    const Pose pose = camera_pose(*poses[f], mounts[f]->pose);
    result.frames.push_back(f);
    result.mounts.push_back(mounts[f]->pose);
    network.centres.push_back(pose.centre);
    network.angles.push_back(xyz_angles(pose.rotation));
    if (!block.frames[f].attitude_prior) continue;
    squares += block.frames[f].attitude_prior->sigma_rad.squaredNorm() / 3;
    ++attitudes;
  }
  if (attitudes > 0) result.angle_sigma_rad = std::sqrt(squares / attitudes);
  for (std::int32_t& camera : network.camera) camera = number[static_cast<std::size_t>(camera)];
}

}  // namespace

Pose CoplanarityBlock::frame_pose(std::size_t camera, const XyzAngles& angles) const {
  const Pose& mount = mounts[camera];
  const Eigen::Quaterniond rotation = (mount.rotation.conjugate() * rotation_from(angles)).normalized();
  return {rotation, network.centres[camera] - rotation.conjugate() * mount.centre};
}

CoplanarityBlock coplanarity_block(const Block& block, const BlockState& start, const std::vector<TrackSet>& tracks) {
  CoplanarityBlock result;
  if (!block.cameras.empty()) result.network.focal_px = block.cameras[CameraIndex(0)].intrinsics[kFocal];
  const KnownPoses poses = known_poses(block, start);
  for (const TrackSet& set : tracks) add_points(block, poses, set, result);
  add_cameras(block, poses, result);
  if (result.frames.size() < 2)
    throw InputError(
        "coplanarity: fewer than two frames with positions, attitudes and common points; the project needs positions "
        "and attitudes or poses, the job 'megablock match', without attitudes 'megablock orient'");
  return result;
}

}  // namespace megablock
