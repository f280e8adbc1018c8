// Estimates the cameras and mounts of a rig from its tie points and its trusted relative poses, as far as registration
// needs an on-line calibration (Cannelle 2013). Mounts that are half a degree wrong shift rays by a dozen pixels, the
// same way in A as in B and in C as in D, but passes that see a place with different cameras then disagree by
// decimetres.
//
// A bundle adjustment of a few windows of successive frames: unknowns are cameras, mounts (both with their priors),
// frames and points; observations are the tracks within one window (passes do not meet) and the chain's relative poses.
// The first frame of each window is held, which fixes its datum. Windows are the ones that turn most, where all three
// rotations of a mount show, and as many spread over the block.
#pragma once

#include <cstdint>
#include <string>

#include "adjust/registration/joint_adjustment.h"
#include "adjust/tile/tile_adjustment.h"
#include "io/block/tracks.h"

namespace megablock {

struct RigEstimateOptions {
  int window_frames = 24;    // successive frames of a pass
  int windows = 10;          // at most
  int min_track = 3;         // observations of a track within its window
  double max_turn_deg = 60;  // beyond it, a window's turn does not count as more
  AdjustOptions adjustment;  // of the windows
  void check() const;        // throws InputError
};

// Whether the block has a camera parameter or a mount to be estimated.
bool has_free_rig(const Block& block);

struct RigEstimate {
  IndexedVector<CameraIndex, Intrinsics> cameras;
  IndexedVector<RigIndex, std::vector<Pose>> mounts;  // [rigs][mounts]
  std::int64_t frames = 0, observations = 0;
  double median_before_px = 0, median_after_px = 0;  // residual lengths, points intersected with either rig
  std::string kept_as_given;                         // why nothing was estimated; empty: it was
};

// `input`: start poses, passes, chain. Never worse than the start: when the residuals do not fall, or there is too
// little to estimate from, the rig stays as given. Deterministic.
RigEstimate estimate_rig(const Block& block, const JointInput& input, const TrackSet& tracks,
                         const RigEstimateOptions& options);

}  // namespace megablock
