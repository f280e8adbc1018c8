// Which tile, or which cell of a tile, a point or an observation of several frames belongs to.
//
// To the one with most of its observations in frames that separate the least (io/block/image_graph.h,
// Tiles::separator_depth), ties to the lower number. Where frames separate the halves of the tree as they should
// (partition/tiles/separators.h), those on different sides of a node never are in one point unless some are in that
// node's separator or in one further up: the points of the two sides then have nothing but these frames in common, and
// no more is passed up the tree than has to be. By most frames of all, without regard to separators, half as many
// frames more are passed up in aerial blocks.
#pragma once

#include <cstdint>
#include <vector>

namespace megablock {

struct OwnerCandidate {
  std::int64_t part;   // tile or cell that a frame lies in
  std::int32_t depth;  // of the node it separates, 0: root; -1: none
};

// One candidate per observation; -1 without any. Changes their order.
std::int64_t owner_part(std::vector<OwnerCandidate>& frames);

}  // namespace megablock
