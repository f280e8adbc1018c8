// Initial orientation in parts: a large component without positions is cut into parts that overlap, each is oriented on
// its own (orientation.h), and the parts are joined as independent models by the frames that they share
// (model_assembly.h). Time and memory grow with the number of frames, not faster.
//
// Cut: halves by the distance, in links, from a frame at the rim, until a part has no more than `part_frames`; then
// every part takes in the frames linked to it. Everything goes by the frames' names, so that their order does not
// matter. The level, or the attitude, is the mean of the parts that know it. Where more than a tenth of the frames
// would be lost, because parts fail or do not fit together, the component is oriented as a whole.
#pragma once

#include "adjust/orientation/orientation.h"

namespace megablock {

// What orient_component does, with options.part_frames > 0. For frames without position and without pose; frames of
// parts that could not be joined to the largest are not oriented.
OrientationResult orient_in_parts(const Block& block, const BlockState& start, const std::vector<FrameIndex>& frames,
                                  const std::vector<VerifiedPair>& pairs, const TrackSet& tracks,
                                  const OrientationOptions& options);

// The parts by themselves, each a list of frames of `frames`; the first `core` of a part are in no other's core.
struct OrientationPart {
  std::vector<FrameIndex> frames;
  std::size_t core = 0;
};
std::vector<OrientationPart> orientation_parts(const Block& block, const std::vector<FrameIndex>& frames,
                                               const std::vector<VerifiedPair>& pairs, int part_frames);

}  // namespace megablock
