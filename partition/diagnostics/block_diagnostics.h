// Finds what a block lacks (io/block/block_diagnostics.h) from what is known of it, before its adjustment or after it.
//
//   steps     A pass (aerial: a flight line) is interrupted where the distance between successive exposures is more
//   than
//             gap_factor times the usual one (twice as much along streets, where vehicles stop and turn).
//   lines     From each exposure of a line the nearest one of another, parallel line is sought to its left within 45
//             degrees. Distances across the lines of more than gap_factor times the usual one are gaps; neighbouring
//             exposures of a line that see the same gap form one. Lines closer than a tenth of a footprint are one.
//   ground    Footprints are counted in a grid of an eighth of their side. Ground that fewer than min_images see is a
//             gap if it lies in a row or column of the grid between ground that enough images see, at most three
//             footprints apart, and the exposures around it lie on all sides of it: the rim of the block is none.
//             Pieces narrower than two cells are left out.
//   links     Parts hang together by links of min_link_points tie points and more; single links are the bridges of this
//             graph (Tarjan 1974).
//   proposals Exposures at even distances in gaps, with the attitudes of their neighbours; in the middle of thin ground
//             that these do not see.
//
// Sorting and searches by k-d tree over the frames, a grid of at most 16 cells an image: O(n log n), in the order of
// the frames.
#pragma once

#include <functional>

#include "io/block/block_diagnostics.h"
#include "partition/links/link_weights.h"

namespace megablock {

// What tie points say of a block.
struct TieEvidence {
  LinkWeights links;                                // common tie points of frames; empty: not known
  IndexedVector<ImageIndex, double> ground_height;  // of what each image sees, z in the block's frame; NaN: not known
};

// Frames with a pose are looked at: those of `state` that are oriented. `gather(with_heights)` is called once: of a
// block that looks down at the beginning, of others, whose heights do not matter, when frames have been looked at.
BlockDiagnostics diagnose(const Block& block, const BlockState& state,
                          const std::function<TieEvidence(bool with_heights)>& gather,
                          const DiagnosticsOptions& options);

// Before anything is oriented: frames with a given pose, or position and attitude prior.
BlockState state_of_priors(const Block& block);

}  // namespace megablock
