// Holds graphs of images and frames, and the results of partition/: cells of pairs, tiles, merge tree.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/base/index.h"

namespace megablock {

struct ImagePair {
  ImageIndex a, b;  // a < b
  friend auto operator<=>(const ImagePair&, const ImagePair&) = default;
};

// Candidate pairs and the cells in which they are matched.
struct CandidateGraph {
  std::vector<ImagePair> pairs;          // ascending by (a, b), distinct
  std::vector<std::int64_t> cell_begin;  // [cells + 1] into cell_pairs
  std::vector<std::int64_t> cell_pairs;  // rows of `pairs`, ascending within a cell; every pair is in exactly one cell
};

// An undirected weighted graph of frames. Each edge (a < b) has the number of verified tracks or matches that the two
// share.
struct FrameEdge {
  FrameIndex a, b;
  std::int64_t weight;
  friend auto operator<=>(const FrameEdge&, const FrameEdge&) = default;
};

struct FrameGraph {
  std::int64_t frame_count = 0;
  std::vector<FrameEdge> edges;  // ascending by (a, b), distinct
};

// The binary tree over tiles from the recursive bisection. Children come before their parents, and the last node of a
// component's tree is its root; a component of one tile is a single leaf. All components have one common root. The
// order of nodes is that of the elimination and of every reduction.
struct MergeTree {
  struct Node {
    std::int64_t left = -1, right = -1, parent = -1;  // -1: none
    TileIndex tile;                                   // valid in leaves only
    std::int32_t level = 0;                           // leaves 0; others 1 + max(children)
  };
  std::vector<Node> nodes;
};

// The partition of a block into tiles.
struct Tiles {
  std::int64_t tile_count = 0;
  IndexedVector<FrameIndex, TileIndex> tile_of_frame;  // invalid: a frame without any verified link (not oriented)
  IndexedVector<FrameIndex, std::int32_t> component;   // number of the connected component, 0 is the largest; -1: none
  MergeTree tree;
  // Depth in the tree (0: root) of the node whose halves a frame separates (partition/tiles/separators.h); -1: none.
  // These depths decide to which tile a point belongs (adjust/problem/owner.h). In a block that has grown, only the
  // order of depths along the tree has a meaning.
  IndexedVector<FrameIndex, std::int32_t> separator_depth;  // [frames]; empty: all -1
  std::int32_t depth_of(FrameIndex frame) const {
    return separator_depth.contains(frame) ? separator_depth[frame] : -1;
  }
  std::vector<FrameEdge> dropped_links;  // weak links between tiles, dropped before the tree was fixed
};

}  // namespace megablock
