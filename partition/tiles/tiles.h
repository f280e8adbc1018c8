// Cuts the frames of a block into tiles, which are adjusted in parallel, by recursive bisection of the graph of frames.
// The tree of the bisections tells how tiles are merged.
#pragma once

#include <vector>

#include "io/block/image_graph.h"

namespace megablock {

struct TileOptions {
  std::int64_t tile_max_frames = 500;  // largest number of frames of a tile
  // Smallest number of tiles, for min_tiles_from frames and more (per component in proportion).
  std::int64_t min_tiles = 4;
  std::int64_t min_tiles_from = 100;  // number of frames
  std::int64_t weak_link_tracks = 8;  // links between tiles with fewer tracks are dropped and listed
  void check() const;                 // throws InputError
};

// Returns tiles, tree, components and separators. Components are numbered by falling size, then by lowest frame. The
// bisection is that of METIS with a fixed seed. Single-threaded, because METIS draws from one global random generator.
//
// A set of frames that fewer than weak_link_tracks tracks in total link to the rest is a component of its own; a single
// such frame gets no tile. Weak links between tiles are dropped. Where this divides a component, its parts become
// components and are cut anew; every component is thus connected without the dropped links. The frames that separate
// the halves of each node follow from the links (separators.h). Throws InputError for impossible options.
Tiles make_tiles(const FrameGraph& graph, const TileOptions& options);

// Adds frames to a block that has tiles. Frames known to `previous` keep their indices, which new frames follow, and
// their tiles. A new frame joins the tile with which it has most tracks; sets of new frames without a link to any tile
// become new tiles. A tile above the limit is bisected: the part with most of its earlier frames keeps its number, the
// others get new numbers. Separators of earlier frames stay; those of bisected tiles and new sets lie below them.
// Throws InputError where the block has fewer frames than `previous`.
Tiles extend_tiles(const FrameGraph& graph, const Tiles& previous, const TileOptions& options);

// A bisection tree of any set of nodes. Each node is assigned to a leaf of at most max_leaf nodes; there are at least
// min_leaves leaves if there are as many nodes; leaves are numbered in the order of the tree. The graph may be
// disconnected. Tiles are cut in this way, and so is the inside of a tile for its elimination (merge/). Throws
// ComputeError where the graph exceeds the 32-bit indices of METIS.
struct BisectionTree {
  std::vector<std::int32_t> leaf_of_node;
  MergeTree tree;  // MergeTree::Node::tile = leaf number
};
BisectionTree bisect(const FrameGraph& graph, std::int64_t max_leaf, std::int64_t min_leaves = 1);

// Appends the parent of two roots of `tree` and returns its number.
std::int64_t join(MergeTree& tree, std::int64_t left, std::int64_t right);

}  // namespace megablock
