// Makes artificial graphs of frames, and checks the properties that every tree over them must have.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "io/block/image_graph.h"

namespace megablock {

inline FrameGraph sorted(std::int64_t frames, std::vector<FrameEdge> edges) {
  std::sort(edges.begin(), edges.end());
  return {frames, std::move(edges)};
}

inline void add(std::vector<FrameEdge>& edges, std::int64_t a, std::int64_t b, std::int64_t weight) {
  edges.push_back({FrameIndex(std::min(a, b)), FrameIndex(std::max(a, b)), weight});
}

// rows x columns frames, numbered from `start`, each linked to its neighbours (more weakly along diagonals).
inline std::vector<FrameEdge> grid(int rows, int columns, std::int64_t start = 0, std::int64_t weight = 100) {
  std::vector<FrameEdge> edges;
  const auto at = [&](int r, int c) { return start + std::int64_t{r} * columns + c; };
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      if (c + 1 < columns) add(edges, at(r, c), at(r, c + 1), weight);
      if (r + 1 < rows) add(edges, at(r, c), at(r + 1, c), weight);
      if (r + 1 < rows && c + 1 < columns) add(edges, at(r, c), at(r + 1, c + 1), weight / 2);
      if (r + 1 < rows && c > 0) add(edges, at(r, c), at(r + 1, c - 1), weight / 2);
    }
  return edges;
}
inline void expect_tree(const MergeTree& tree, std::int64_t tiles) {
  ASSERT_EQ(tree.nodes.size(), tiles == 0 ? 0u : static_cast<std::size_t>(2 * tiles - 1));
  std::set<std::int64_t> leaves;
  int roots = 0;
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    const MergeTree::Node& node = tree.nodes[n];
    const auto number = static_cast<std::int64_t>(n);
    roots += node.parent < 0;
    if (node.parent >= 0) {
      EXPECT_GT(node.parent, number) << "children come before parents";
    }
    ASSERT_EQ(node.left < 0, node.right < 0);
    if (node.left < 0) {
      EXPECT_EQ(node.level, 0);
      EXPECT_TRUE(leaves.insert(node.tile.value).second);
    } else {
      EXPECT_FALSE(node.tile.valid());
      const auto& left = tree.nodes.at(static_cast<std::size_t>(node.left));
      const auto& right = tree.nodes.at(static_cast<std::size_t>(node.right));
      EXPECT_EQ(left.parent, number);
      EXPECT_EQ(right.parent, number);
      EXPECT_EQ(node.level, 1 + std::max(left.level, right.level));
    }
  }
  EXPECT_EQ(roots, tiles == 0 ? 0 : 1);
  if (tiles > 0) {
    EXPECT_EQ(tree.nodes.back().parent, -1);
    EXPECT_EQ(*leaves.begin(), 0);
    EXPECT_EQ(*leaves.rbegin(), tiles - 1);
  }
}

}  // namespace megablock
