// Stores the adjustment of a tile in a file (shapes, types and units: docs/reference/file-formats.md, "Adjustment").
//
// The writer makes a plain HDF5 file at `path`, which JobStore::write seals. The reader throws StoreError with the name
// of the file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// The result of a tile's adjustment: its values of the unknowns, its points, and a verdict on each observation. The
// observations have the order of the rows of the tile's track file, followed by those of its control points in block
// order.
struct TileAdjustment {
  std::vector<FrameIndex> frames;
  std::vector<Pose> poses;  // [frames]
  // [frames] number of kept observations. A frame of several tiles starts from the tile with most of them.
  std::vector<std::int64_t> observations;
  std::vector<CameraIndex> cameras;
  std::vector<Intrinsics> intrinsics;             // [cameras]
  std::vector<std::int64_t> camera_observations;  // [cameras]
  std::vector<RigIndex> mount_rigs;
  std::vector<std::int32_t> mount_numbers;       // [mount_rigs] number of the mount in its rig
  std::vector<Pose> mounts;                      // [mount_rigs]
  std::vector<std::int64_t> mount_observations;  // [mount_rigs]
  std::vector<std::uint8_t> parts;  // [rows of the track file] part of its track (adjust/tile/track_parts.h)
  // For the tracks after they were split into these parts:
  std::vector<Eigen::Vector3d> points;  // [tracks + control points]; NaN = not triangulated
  std::vector<std::uint8_t> kept;       // [observations of tracks, then of control points] 1 = kept
  double image_sigma_px = 0;            // of tie points, as used in the adjustment of the tile
  // Rows of Block::control_points that took no part, because they contradict the images (adjust/checks/control_check.h).
  std::vector<std::int64_t> control_aside;
  std::string summary;                  // one line for the log and the report
};
void write_adjustment(const std::string& path, const TileAdjustment& adjustment);
TileAdjustment read_adjustment(const std::string& path);

}  // namespace megablock
