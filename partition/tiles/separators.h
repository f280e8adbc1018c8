// Finds the separators of a bisection: for every node of the tree, a set of frames without which its two halves have no
// links.
//
// The tie points of the two halves can be distributed so that only these frames occur in points of both halves
// (adjust/problem/owner.h); the elimination sends their unknowns up to the node. The smallest such set is a smallest
// vertex cover of the bipartite graph of links between the halves. It has as many frames as a largest matching has
// links (D. Koenig, 1931), and follows from one (J. Hopcroft and R. Karp, SIAM J. Comput. 2(4), 1973). Links of frames
// that already separate a node higher up are left out.
#pragma once

#include <vector>

#include "io/block/image_graph.h"

namespace megablock {

// For each frame the depth (root: 0) of the node whose halves it separates; -1: none. `leaf_of_frame` is the TileIndex
// of the frame's leaf; -1: none. Links of every weight count, because tracks may hold two frames together by way of
// others even where the link was dropped as weak. Frames with a nonzero `apart` are taken as removed beforehand and get
// -1; an empty list removes none.
std::vector<std::int32_t> separator_depths(const FrameGraph& graph, const std::vector<std::int32_t>& leaf_of_frame,
                                           const MergeTree& tree, const std::vector<std::uint8_t>& apart = {});

// Depth of every node.
std::vector<std::int32_t> depths(const MergeTree& tree);

}  // namespace megablock
