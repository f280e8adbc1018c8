// Graphs over images or frames, and what partition/ makes of them: cells of pairs, tiles, the merge tree.
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

// Candidate pairs and the spatial cells that are the units of matching.
struct CandidateGraph {
  std::vector<ImagePair> pairs;          // ascending by (a, b), distinct
  std::vector<std::int64_t> cell_begin;  // [cells + 1] into cell_pairs
  std::vector<std::int64_t> cell_pairs;  // rows of `pairs`, ascending within a cell; every pair in exactly one cell
};

// Undirected weighted graph of frames: edges (a < b) with the number of verified tracks (or matches) across.
struct FrameEdge {
  FrameIndex a, b;
  std::int64_t weight;
  friend auto operator<=>(const FrameEdge&, const FrameEdge&) = default;
};

struct FrameGraph {
  std::int64_t frame_count = 0;
  std::vector<FrameEdge> edges;  // ascending by (a, b), distinct
};

// Binary tree over tiles from the recursive bisection. Children come before parents; the last node of a component's
// tree is its root; a component of one tile is a single leaf. All components hang under one common root (node order is
// the order of elimination and of every reduction).
struct MergeTree {
  struct Node {
    std::int64_t left = -1, right = -1, parent = -1;  // -1: none
    TileIndex tile;                                   // valid for leaves only
    std::int32_t level = 0;                           // leaves 0; else 1 + max(children)
  };
  std::vector<Node> nodes;
};

struct Tiles {
  std::int64_t tile_count = 0;
  IndexedVector<FrameIndex, TileIndex> tile_of_frame;  // invalid: frame without any verified link (not oriented)
  IndexedVector<FrameIndex, std::int32_t> component;   // connected component, -1: none; 0 is the largest
  MergeTree tree;
  // Depth in the tree (0: root) of the node whose halves a frame separates (partition/tiles/separators.h); -1: none. In
  // a block that grew only the order of depths along the tree has a meaning. They decide which tile a point belongs to
  // (adjust/problem/owner.h).
  IndexedVector<FrameIndex, std::int32_t> separator_depth;  // [frames]; none: all -1
  std::int32_t depth_of(FrameIndex frame) const {
    return separator_depth.contains(frame) ? separator_depth[frame] : -1;
  }
  std::vector<FrameEdge> dropped_links;  // weak links between tiles, dropped before the tree was fixed
};

}  // namespace megablock
