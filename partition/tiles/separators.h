// Separators of a bisection: at every node of the tree, frames without which its two halves have no links.
//
// The points of a node's halves can be shared out so that no other frames than these are in points of both
// (adjust/problem/owner.h); they are what the elimination passes up to the node. The fewest frames that cover all links
// between the halves are a least vertex cover of a bipartite graph, as many as its largest matching has links (König
// 1931); matchings by Hopcroft and Karp (1973). Links of frames that separate a node further up are cut already.
#pragma once

#include <vector>

#include "io/block/image_graph.h"

namespace megablock {

// Depth (root 0) of the node whose halves a frame separates; -1: none. leaf_of_frame: TileIndex of the tree's leaf, -1:
// none. Links of any weight count: where a link was dropped as weak, tracks may still hold both frames, by way of
// others. `apart` (not 0): frames that are cut off from the outset; they get -1. Empty: none.
std::vector<std::int32_t> separator_depths(const FrameGraph& graph, const std::vector<std::int32_t>& leaf_of_frame,
                                           const MergeTree& tree, const std::vector<std::uint8_t>& apart = {});

// Depth of every node.
std::vector<std::int32_t> depths(const MergeTree& tree);

}  // namespace megablock
