// Orients a large component without positions in parts, so that time and memory grow in proportion to the number of
// frames. The component is cut into overlapping parts, each part is oriented by itself (orientation.h), and the parts
// are joined as independent models by the frames that they share (model_assembly.h).
//
// The cut halves a set of frames by the distance in links from a frame at its rim, until a part has at most
// `part_frames` frames. Each part then takes in the frames that are linked to it. The cut goes by the names of the
// frames, so that their order does not matter. The vertical, or the attitude, of the block is the mean of the parts
// that know it. If more than a tenth of the frames would be lost, because parts fail or do not fit together, the
// component is oriented as a whole.
#pragma once

#include "adjust/orientation/orientation.h"

namespace megablock {

// Does the work of orient_component() in parts of options.part_frames > 0 frames, for frames without position priors
// and without given poses. Frames of parts that cannot be joined to the largest one are not oriented.
OrientationResult orient_in_parts(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                  const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                  const OrientationOptions& options);

// The parts of the cut, each a list of frames of `frames`. Its first `core` frames belong to no other part's core; the
// rest is the overlap.
struct OrientationPart {
  std::vector<FrameIndex> frames;
  std::size_t core = 0;
};
std::vector<OrientationPart> orientation_parts(const Block& block, const std::vector<FrameIndex>& frames,
                                               const std::vector<VerifiedPair>& pairs, int part_frames);

}  // namespace megablock
