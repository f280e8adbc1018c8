// Brings tiles that were adjusted on their own into one ground frame before the merge. Each tile gets a similarity, and
// all similarities are adjusted jointly on the frames that tiles have in common.
//
// Each tile has the datum of its own priors or start values. Where these are weak (positions good to metres),
// neighbours differ by many times the precision of their observations, and a block assembled from them is far from any
// optimum. The adjustment minimises, with S_t near the identity, over every frame and every tile t that holds it; h is
// the tile with most observations of the frame, and t is another one:
//
//     sum rho(|S_t C_t - S_h C_h|^2 / p^2) + rho(angle(S_t R_t, S_h R_h)^2 / r^2)  +  sum over tiles |S_t - 1|^2 / a^2
//
// rho is the Cauchy loss, because frames at the rim of a tile depend on few points. p and r are the medians of the
// differences, updated in each of a few iterations. The last term keeps the block at the mean place of its tiles; a is
// the first p, and the term acts on the shift of a tile and on the displacement by rotation and scale at its extent.
// Internal to merge/: it is not installed.
#pragma once

#include <vector>

#include "geometry/similarity/similarity.h"
#include "io/base/index.h"

namespace megablock {

// Frames with fewer observations are not used.
constexpr std::int64_t kFewestAlignmentObservations = 20;

struct AlignmentTile {
  std::vector<FrameIndex> frames;
  std::vector<Pose> poses;                 // [frames]
  std::vector<std::int64_t> observations;  // [frames] kept ones
};

// Returns one similarity for each tile, applied as S(pose); the identity for a tile that shares no frame.
std::vector<Similarity> align_tiles(const std::vector<AlignmentTile>& tiles);

}  // namespace megablock
