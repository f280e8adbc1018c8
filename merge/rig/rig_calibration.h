// Calibrates the rigs of a block (Cannelle 2013): adjustment, posterior sigmas, comparison with the start.
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

// `start`: frames with their approximate poses, cameras and mounts as the block gives them. The result is compared with
// the start on tracks that were left out at first, or on the other site. It is refused (RigCalibration::refused) when
// it fits no better. Throws InputError for blocks without anything to calibrate or measure, ComputeError when the
// adjustment fails. Deterministic.
CalibratedRig calibrate_rig(const Block& block, const BlockState& start, const TrackSet& tracks,
                            const RigCalibrationOptions& options,
                            const std::optional<VerificationSite>& verification = {});

}  // namespace megablock
