// Decides which tile, or which cell of a tile, owns a point or an observation of several frames.
//
// It is the one with most observations in those frames that separate the least (io/block/image_graph.h,
// Tiles::separator_depth); ties go to the lower number. Suppose that frames separate the halves of the tree as they
// should (partition/tiles/separators.h). Frames on different sides of a node then never occur in one point, unless some
// of its frames are in the separator of this node or of a higher one. The points of the two sides have only these
// frames in common, and the separators in the tree are as small as possible. If simply most frames decided, separators
// in aerial blocks would have 50 % more frames.
#pragma once

#include <cstdint>
#include <vector>

namespace megablock {

struct OwnerCandidate {
  std::int64_t part;   // tile or cell that a frame lies in
  std::int32_t depth;  // depth of the node that it separates, 0: root; -1: none
};

// One candidate for each observation. Returns -1 without candidates. Changes their order.
std::int64_t owner_part(std::vector<OwnerCandidate>& frames);

}  // namespace megablock
