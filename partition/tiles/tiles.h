// Recursive bisection of the frame graph into tiles, and its binary tree.
#pragma once

#include <vector>

#include "io/block/image_graph.h"

namespace megablock {

struct TileOptions {
  std::int64_t tile_max_frames = 500;  // of a tile
  std::int64_t min_tiles = 4;          // from min_tiles_from frames up (per component in proportion)
  std::int64_t min_tiles_from = 100;   // frames
  std::int64_t weak_link_tracks = 8;   // frame pairs across tiles with fewer tracks are dropped and listed
  void check() const;                  // throws InputError
};

// METIS recursive bisection with fixed seed; components by size (descending), then lowest frame. Single-threaded (METIS
// draws from one global generator).
//
// Sets of frames that hang together by fewer than weak_link_tracks tracks in total are components of their own; a frame
// left alone gets no tile. Weak links between tiles are dropped; where that separates a component, its parts are
// components and are cut anew, so that every component stays connected without the dropped links. What separates the
// halves of each node follows from the links (separators.h).
Tiles make_tiles(const FrameGraph& graph, const TileOptions& options);

// Keeps the assignment of frames known to `previous` (same indices; new frames may follow them); new frames join the
// tile with most tracks, new sets of frames without a link to any tile become tiles of their own. A tile over the limit
// is bisected: the part with most of its former frames keeps its number, other parts get new numbers. What
// separates former frames stays; what separates the parts of bisected tiles and new sets comes below it.
Tiles extend_tiles(const FrameGraph& graph, const Tiles& previous, const TileOptions& options);

// One bisection tree of any node set: assignment of each node to a leaf of at most max_leaf nodes, at least min_leaves
// leaves where there are as many nodes, leaves numbered in tree order. The graph may be disconnected. The same routine
// serves tiles and the cells inside a tile (merge/). ComputeError when the graph exceeds METIS's 32-bit indices.
struct BisectionTree {
  std::vector<std::int32_t> leaf_of_node;
  MergeTree tree;  // MergeTree::Node::tile = leaf number
};
BisectionTree bisect(const FrameGraph& graph, std::int64_t max_leaf, std::int64_t min_leaves = 1);

// Appends the parent of two roots of `tree`; returns its number.
std::int64_t join(MergeTree& tree, std::int64_t left, std::int64_t right);

}  // namespace megablock
