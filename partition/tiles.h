// Recursive bisection of the frame graph into tiles, and its binary tree.
#pragma once

#include <vector>

#include "io/image_graph.h"

namespace megablock {

struct TileOptions {
  std::int64_t tile_max_frames = 500;    // of a tile
  std::int64_t min_tiles = 4;            // from min_tiles_from frames up (per component in proportion)
  std::int64_t min_tiles_from = 100;     // frames
  std::int64_t weak_link_tracks = 8;     // frame pairs across tiles with fewer tracks are dropped and listed
  void check() const;                    // throws InputError
};

// METIS recursive bisection with fixed seed; components by size (descending), then lowest frame. Single-threaded.
Tiles make_tiles(const FrameGraph& graph, const TileOptions& options);

// Keeps the assignment of frames known to `previous`; new frames join the tile with most links; a tile over the limit
// is bisected.
Tiles extend_tiles(const FrameGraph& graph, const Tiles& previous, const TileOptions& options);

// One bisection tree of any node set: assignment of each node to a leaf of at most max_leaf nodes, leaves numbered in
// tree order. The same routine serves tiles and the cells inside a tile (merge/).
struct BisectionTree {
  std::vector<std::int32_t> leaf_of_node;
  MergeTree tree;  // MergeTree::Node::tile = leaf number
};
BisectionTree bisect(const FrameGraph& graph, std::int64_t max_leaf);

}  // namespace megablock
