// Estimates the cameras and mounts of a rig from its tie points and its trusted relative poses, as far as registration
// needs an on-line calibration (Cannelle 2013). Mounts that are half a degree wrong shift rays by a dozen pixels. The
// shift is the same in A and B, and in C and D, but passes that see a place with different cameras then disagree by
// decimetres.
//
// The method is a bundle adjustment of a few windows of successive frames. The unknowns are cameras, mounts (both with
// their priors), frames and points. The observations are the tracks within one window (passes are not connected) and
// the relative poses of the chain. The first frame of each window is held, which fixes the datum of the window. Half of
// the windows are those that turn most, where all three rotations of a mount show; the others are spread over the
// block.
#pragma once

#include <cstdint>
#include <string>

#include "adjust/registration/joint_adjustment.h"
#include "adjust/tile/tile_adjustment.h"
#include "io/block/tracks.h"

namespace megablock {

// With mounts half a degree off, 1 of 279 places could be registered as given, and 237 after this estimate
// (docs/developer/decisions.md, "Matching of street rigs").
struct RigEstimateOptions {
  int window_frames = 24;    // successive frames of a pass
  int windows = 10;          // at most
  int min_track = 3;         // observations of a track within its window
  double max_turn_deg = 60;  // a window that turns more is not preferred for it
  AdjustOptions adjustment;  // of the windows
  void check() const;        // throws InputError
};

// Whether the block has a camera parameter or a mount to be estimated.
bool has_free_rig(const Block& block);

struct RigEstimate {
  IndexedVector<CameraIndex, Intrinsics> cameras;
  IndexedVector<RigIndex, std::vector<Pose>> mounts;  // [rigs][mounts]
  std::int64_t frames = 0, observations = 0;
  // Residual lengths, with points intersected by the rig before and after.
  double median_before_px = 0, median_after_px = 0;
  std::string kept_as_given;  // why nothing was estimated; empty: the rig was estimated
};

// `input` has start poses, passes and chain. The result is never worse than the start: when the residuals do not fall,
// or there are too few observations, the rig stays as given. Deterministic.
RigEstimate estimate_rig(const Block& block, const JointInput& input, const TrackSet& tracks,
                         const RigEstimateOptions& options);

}  // namespace megablock
