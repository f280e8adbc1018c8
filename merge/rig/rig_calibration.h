// Calibrates the rigs of a block (Cannelle 2013): it adjusts cameras and mounts, gives their posterior sigmas, and
// compares the result with the start.
#pragma once

#include "adjust/calibration/rig_observations.h"

namespace megablock {

// Another block that the same rig recorded. Start and result are compared on it with the rig held.
struct VerificationSite {
  Block block;
  TrackSet tracks;
};

struct CalibratedRig {
  RigCalibration calibration;
  BlockState state;
};

// `start` has the frames with their approximate poses, and cameras and mounts as the block gives them. Result and start
// are compared on tracks that were held out, or on the other site. A result that fits no better than the start is
// refused (RigCalibration::refused). Throws InputError when the block has nothing to calibrate or no observations, and
// ComputeError when the adjustment fails. Deterministic.
CalibratedRig calibrate_rig(const Block& block, const BlockState& start, const TrackSet& tracks,
                            const RigCalibrationOptions& options,
                            const std::optional<VerificationSite>& verification = {});

}  // namespace megablock
