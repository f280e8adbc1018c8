// Finds weaknesses of a block (io/block/block_diagnostics.h), before or after its adjustment:
//
// * Steps: a pass (in aerial blocks a flight line) is interrupted where the distance between successive exposures
//   exceeds gap_factor times the usual one; along streets twice that, because vehicles stop and turn.
// * Lines: for each exposure of a line, the nearest exposure of another, parallel line is sought to its left, within 45
//   degrees. Distances across the lines of more than gap_factor times the usual one are gaps; neighbouring exposures of
//   a line with the same gap form one. Lines closer than a tenth of a footprint count as one.
// * Ground: footprints are counted in a grid whose cells have an eighth of their side. Ground seen by fewer than
//   min_images images is a gap if, in its row or column of the grid, it lies between ground that enough images see, at
//   most three footprints apart, and if exposures lie on all sides of it. The rim of the block is therefore no gap.
//   Pieces narrower than two cells are left out.
// * Links: frames belong to one part if links of min_link_points or more tie points join them. Single links are the
//   bridges of this graph (R. E. Tarjan, Information Processing Letters 2(6), 1974).
// * Proposals: exposures at equal distances in the gaps, with the attitudes of their neighbours, and in the middle of
//   thin ground that these do not cover.
//
// The time is O(n log n): sorting, searches by k-d tree over the frames, and a grid of at most 16 cells per image. The
// results are in the order of the frames.
#pragma once

#include <functional>

#include "io/block/block_diagnostics.h"
#include "partition/links/link_weights.h"

namespace megablock {

// The knowledge about a block that tie points give.
struct TieEvidence {
  LinkWeights links;  // numbers of common tie points of frames; empty: unknown
  // Height of the ground that each image sees, z in the block's frame; NaN: unknown.
  IndexedVector<ImageIndex, double> ground_height;
};

// Diagnoses the frames of `state` that are oriented. `gather(with_heights)` is called once to collect the evidence of
// tie points: in blocks that look down at the beginning; in others, whose ground heights do not matter, after the
// frames were examined. Throws InputError for impossible options.
BlockDiagnostics diagnose(const Block& block, const BlockState& state,
                          const std::function<TieEvidence(bool with_heights)>& gather,
                          const DiagnosticsOptions& options);

// The state before anything is oriented: frames with a given pose, or with position and attitude prior, count as
// oriented.
BlockState state_of_priors(const Block& block);

}  // namespace megablock
