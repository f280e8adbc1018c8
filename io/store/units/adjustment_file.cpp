// Reads and writes the result of a tile's adjustment (docs/reference/file-formats.md, "Adjustment").
#include "io/store/units/adjustment_file.h"

#include "io/store/hdf5/hdf5_cameras.h"

namespace megablock {

void write_adjustment(const std::string& path, const TileAdjustment& adjustment) {
  Hdf5Writer file(path, "adjustment");
  file.attribute("/", "summary", adjustment.summary);
  file.attribute("/", "image_sigma_px", adjustment.image_sigma_px);
  file.group("frames", "frames the tile's residuals touch");
  file.vector("frames/index", plain(adjustment.frames), {"", "frame index in the block"});
  write_poses(file, "frames", adjustment.poses, "rig", "ground frame");
  file.vector("frames/observations", adjustment.observations, {"", "number of kept observations"});
  file.group("cameras", "cameras the tile's residuals touch");
  file.vector("cameras/index", plain(adjustment.cameras), {"", "camera index in the block"});
  put_models(file, models_of(adjustment.intrinsics));
  put_intrinsics(file, adjustment.intrinsics, "adjusted values of the parameters");
  file.vector("cameras/observations", adjustment.camera_observations, {"", "number of kept observations"});
  file.group("mounts", "mounts of the rigs that the tile's residuals touch");
  file.vector("mounts/rig", plain(adjustment.mount_rigs), {"", "rig index in the block"});
  file.vector("mounts/mount", adjustment.mount_numbers, {"", "number of the mount in its rig"});
  write_poses(file, "mounts", adjustment.mounts, "camera", "rig");
  file.vector("mounts/observations", adjustment.mount_observations, {"", "number of kept observations"});
  file.group("tracks", "of the tile's track file");
  file.vector("tracks/part", adjustment.parts,
              {"", "per observation: part of its track; parts above 0 are tracks of their own, behind it"});
  file.group("points", "the tile's tracks, split into their parts, then its control points in block order");
  file.matrix("points/position", vectors3(adjustment.points, [](const Eigen::Vector3d& p) { return p; }), 3,
              {"m", "ground frame; NaN: not triangulated"});
  file.group("observations", "of the tile's tracks, split into their parts, then of its control points");
  file.vector("observations/kept", adjustment.kept, {"", "1: kept, 0: rejected"});
  file.group("control", "control points of the block");
  file.vector("control/aside", adjustment.control_aside, {"", "rows of those that took no part"});
  file.close();
}

TileAdjustment read_adjustment(const std::string& path) {
  const Hdf5Reader file(path, "adjustment");
  TileAdjustment adjustment;
  adjustment.summary = file.text_attribute("/", "summary");
  adjustment.image_sigma_px = file.attribute<double>("/", "image_sigma_px");
  adjustment.frames = indices<FrameIndex>(file.vector<std::int64_t>("frames/index"));
  const auto frames = static_cast<std::int64_t>(adjustment.frames.size());
  adjustment.poses = read_poses(file, "frames", frames);
  adjustment.observations = file.vector<std::int64_t>("frames/observations", frames);
  adjustment.cameras = indices<CameraIndex>(file.vector<std::int64_t>("cameras/index"));
  const auto cameras = static_cast<std::int64_t>(adjustment.cameras.size());
  adjustment.intrinsics = get_intrinsics(file, cameras);
  adjustment.camera_observations = file.vector<std::int64_t>("cameras/observations", cameras);
  adjustment.mount_rigs = indices<RigIndex>(file.vector<std::int64_t>("mounts/rig"));
  const auto mounts = static_cast<std::int64_t>(adjustment.mount_rigs.size());
  adjustment.mount_numbers = file.vector<std::int32_t>("mounts/mount", mounts);
  adjustment.mounts = read_poses(file, "mounts", mounts);
  adjustment.mount_observations = file.vector<std::int64_t>("mounts/observations", mounts);
  adjustment.parts = file.vector<std::uint8_t>("tracks/part");
  const auto points = file.matrix<double>("points/position", 3);
  for (std::size_t p = 0; p < points.size() / 3; ++p) adjustment.points.push_back(vector3(points, p));
  adjustment.kept = file.vector<std::uint8_t>("observations/kept");
  adjustment.control_aside = file.vector<std::int64_t>("control/aside");
  return adjustment;
}

}  // namespace megablock
