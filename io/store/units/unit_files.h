// Readers and writers of the unit files: one pair of functions per kind (shapes, types and units: docs/job-format.md).
// Writers write a plain HDF5 file at `path` (JobStore::write seals it); readers throw StoreError naming the file.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/features.h"
#include "io/block/image_graph.h"
#include "io/block/set_aside_vertical.h"
#include "io/block/tracks.h"

namespace megablock {

// `after_table` is called behind every table that is written.
void write_block(const std::string& path, const Block& block, std::function<void()> after_table = {});
Block read_block(const std::string& path);
Block read_block_without_names(const std::string& path);          // all but Block::image_names
NameTable<ImageIndex> read_image_names(const std::string& path);  // these

void write_features(const std::string& path, const std::vector<ImageFeatures>& images);
std::vector<ImageFeatures> read_features(const std::string& path);
// Without the keypoints' descriptors: an eighth of the bytes.
std::vector<ImageFeatures> read_keypoints(const std::string& path);

void write_candidates(const std::string& path, const CandidateGraph& graph);
CandidateGraph read_candidates(const std::string& path);

void write_matches(const std::string& path, const std::vector<VerifiedPair>& pairs);
std::vector<VerifiedPair> read_matches(const std::string& path);

void write_tiles(const std::string& path, const Tiles& tiles);
Tiles read_tiles(const std::string& path);

void write_tracks(const std::string& path, const TrackSet& tracks);
TrackSet read_tracks(const std::string& path);

// Poses, intrinsics and mounts of the whole block (after orientation, after each global iteration).
void write_state(const std::string& path, const BlockState& state);
BlockState read_state(const std::string& path);

// The initial orientation: a state, why frames got no pose, and verticals that are not believed.
struct InitialOrientation {
  BlockState state;
  std::vector<std::pair<FrameIndex, std::string>> failed;
  std::vector<SetAsideVertical> verticals_aside;
};
void write_orientation(const std::string& path, const InitialOrientation& orientation);
InitialOrientation read_orientation(const std::string& path);

// What a tile's adjustment leaves: its view of the unknowns, its points and the verdict on each observation, aligned
// with the rows of the tile's track file (then its control points in block order).
struct TileAdjustment {
  std::vector<FrameIndex> frames;
  std::vector<Pose> poses;                 // [frames]
  std::vector<std::int64_t> observations;  // [frames], kept ones: the boundary frame starts from the richest tile
  std::vector<CameraIndex> cameras;
  std::vector<Intrinsics> intrinsics;             // [cameras]
  std::vector<std::int64_t> camera_observations;  // [cameras]
  std::vector<RigIndex> mount_rigs;
  std::vector<std::int32_t> mount_numbers;       // [mount_rigs] of the mount in its rig
  std::vector<Pose> mounts;                      // [mount_rigs]
  std::vector<std::int64_t> mount_observations;  // [mount_rigs]
  std::vector<std::uint8_t> parts;  // [rows of the track file] part of its track (adjust/tile/track_parts.h)
  // Of the tracks split into these parts:
  std::vector<Eigen::Vector3d> points;  // [tracks + control points]; NaN = not triangulated
  std::vector<std::uint8_t> kept;       // [observations of tracks, then of control points] 1 = kept
  double image_sigma_px = 0;            // of tie point measurements, with which the tile was adjusted
  std::string summary;                  // one line for the log and the report
};
void write_adjustment(const std::string& path, const TileAdjustment& adjustment);
TileAdjustment read_adjustment(const std::string& path);

}  // namespace megablock
