// Finds which parameters of the cameras of a block its images determine (parameter_choice.h), from a sample of the
// block.
#pragma once

#include <vector>

#include "adjust/tile/tile_adjustment.h"
#include "merge/camera/parameter_choice.h"

namespace megablock {

// `state` is oriented for the frames of the sample alone, and `tracks` has observations in these frames. `cameras` are
// those to choose for, ascending; cameras of the sample that are not among them are estimated as the block says. The
// choice of each, in the order of `cameras`. `readout_s` [cameras of the block]: of rolling shutters, 0 for none.
// Throws ComputeError when the sample cannot be adjusted. Deterministic.
std::vector<CameraChoice> determined_parameters(const Block& block, const BlockState& state, const TrackSet& tracks,
                                                const std::vector<CameraIndex>& cameras,
                                                const IndexedVector<CameraIndex, double>& readout_s,
                                                const AdjustOptions& adjustment, const ParameterChoiceOptions& options);

}  // namespace megablock
