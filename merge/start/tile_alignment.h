// Tiles that were adjusted on their own, brought into one frame before they are merged: a similarity for each, adjusted
// jointly on the frames that tiles have in common.
//
// Each tile carries the datum that its own priors or start values give it. Where those are weak (positions of metres),
// neighbours differ by many times what their images see, and a block put together from them is far from any optimum.
// With S_t near the identity, for every frame and every tile t that holds it besides the one with most observations, h:
//
//     sum rho(|S_t C_t - S_h C_h|^2 / p^2) + rho(angle(S_t R_t, S_h R_h)^2 / r^2)  +  sum over tiles |S_t - 1|^2 / a^2
//
// rho = Cauchy: frames at the rim hang on few points; p, r = medians of the differences themselves, taken anew in each
// of a few rounds; the last term keeps the block where its tiles say it is: a = the first p, and acts on the tile's
// shift and on what rotation and scale do at its extent.
#pragma once

#include <vector>

#include "geometry/similarity/similarity.h"
#include "io/base/index.h"

namespace megablock {

// Frames with fewer observations say nothing of where a tile is.
constexpr std::int64_t kFewestAlignmentObservations = 20;

struct AlignmentTile {
  std::vector<FrameIndex> frames;
  std::vector<Pose> poses;                 // [frames]
  std::vector<std::int64_t> observations;  // [frames] kept ones
};

// One similarity per tile, applied as S(pose). Identity for tiles that share no frame.
std::vector<Similarity> align_tiles(const std::vector<AlignmentTile>& tiles);

}  // namespace megablock
