// Separators of bisections: against all sets of frames of small graphs, and against the overlap of large ones.
#include "partition/tiles/separators.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "io/simulate/images/vehicle_view.h"
#include "partition/tiles/tiles.h"

namespace megablock {
namespace {

// A tree of two leaves under one root.
MergeTree two_leaves() {
  MergeTree tree;
  tree.nodes.resize(2);
  tree.nodes[0].tile = TileIndex(0);
  tree.nodes[1].tile = TileIndex(1);
  join(tree, 0, 1);
  return tree;
}

FrameGraph graph(std::int64_t frames, std::vector<std::pair<int, int>> links, std::int64_t weight = 100) {
  FrameGraph result;
  result.frame_count = frames;
  for (auto [a, b] : links) result.edges.push_back({FrameIndex(std::min(a, b)), FrameIndex(std::max(a, b)), weight});
  std::sort(result.edges.begin(), result.edges.end());
  return result;
}

bool covers(std::uint32_t frames, const FrameGraph& links) {
  return std::all_of(links.edges.begin(), links.edges.end(),
                     [&](const FrameEdge& e) { return (frames >> e.a.value & 1) || (frames >> e.b.value & 1); });
}

TEST(Separators, OfOneLinkAndOfAStarAreOneFrame) {
  const MergeTree tree = two_leaves();
  const std::vector<std::int32_t> leaves = {0, 0, 0, 1, 1, 1};
  const auto count = [](const std::vector<std::int32_t>& depth) { return std::count(depth.begin(), depth.end(), 0); };
  EXPECT_EQ(count(separator_depths(graph(6, {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}}), leaves, tree)), 1);
  EXPECT_EQ(separator_depths(graph(6, {{0, 3}, {0, 4}, {0, 5}, {1, 2}}), leaves, tree),
            (std::vector<std::int32_t>{0, -1, -1, -1, -1, -1}));
  EXPECT_EQ(separator_depths(graph(6, {{0, 4}, {1, 4}, {2, 4}, {3, 5}}), leaves, tree),
            (std::vector<std::int32_t>{-1, -1, -1, -1, 0, -1}));
  EXPECT_EQ(count(separator_depths(graph(6, {{0, 1}, {1, 2}, {3, 4}, {4, 5}}), leaves, tree)), 0);
}

TEST(Separators, LeaveOutFramesThatAreApartAndFramesWithoutLeaf) {
  const MergeTree tree = two_leaves();
  const FrameGraph links = graph(4, {{0, 2}, {1, 3}});
  EXPECT_EQ(separator_depths(links, {0, 0, 1, 1}, tree, {1, 0, 0, 1}), (std::vector<std::int32_t>(4, -1)));
  EXPECT_EQ(separator_depths(links, {0, -1, 1, 1}, tree)[3], -1);
}

// Compared with all sets of frames, for random links between two halves of seven.
TEST(Separators, AreTheFewestFramesThatCoverTheLinks) {
  constexpr int kHalf = 7;
  const MergeTree tree = two_leaves();
  std::vector<std::int32_t> leaves(2 * kHalf, 0);
  std::fill(leaves.begin() + kHalf, leaves.end(), 1);
  std::mt19937 random(1);
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<std::pair<int, int>> links;
    for (int a = 0; a < kHalf; ++a)
      for (int b = kHalf; b < 2 * kHalf; ++b)
        if (random() % 8 < static_cast<unsigned>(1 + trial % 4)) links.emplace_back(a, b);
    const FrameGraph between = graph(2 * kHalf, links);
    int fewest = 2 * kHalf;
    for (std::uint32_t set = 0; set < 1u << (2 * kHalf); ++set)
      if (covers(set, between)) fewest = std::min(fewest, __builtin_popcount(set));
    const std::vector<std::int32_t> depth = separator_depths(between, leaves, tree);
    std::uint32_t found = 0;
    for (std::size_t f = 0; f < depth.size(); ++f) found |= static_cast<std::uint32_t>(depth[f] == 0) << f;
    EXPECT_TRUE(covers(found, between));
    EXPECT_EQ(__builtin_popcount(found), fewest) << trial;
  }
}

// 80 x 40 frames linked over four columns and two rows, as in blocks with 80 and 60 % overlap.
TEST(Separators, CutEveryNodeOfATreeByAboutWhatTheOverlapIs) {
  constexpr int kColumns = 80, kRows = 40;
  std::vector<std::pair<int, int>> links;
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c)
      for (int dr = 0; dr <= 2; ++dr)
        for (int dc = dr == 0 ? 1 : -4; dc <= 4; ++dc)
          if (r + dr < kRows && c + dc >= 0 && c + dc < kColumns)
            links.emplace_back(r * kColumns + c, (r + dr) * kColumns + c + dc);
  const FrameGraph block = graph(kColumns * kRows, links);
  const BisectionTree cut = bisect(block, 100);
  const std::vector<std::int32_t> depth = separator_depths(block, cut.leaf_of_node, cut.tree);
  const std::vector<std::int32_t> node_depth = depths(cut.tree);

  // Every link between two leaves is cut at the node where they part, or higher up.
  std::vector<std::vector<std::int64_t>> path(static_cast<std::size_t>(
      1 + *std::max_element(cut.leaf_of_node.begin(), cut.leaf_of_node.end())));  // of every leaf, from the root
  for (std::size_t n = 0; n < cut.tree.nodes.size(); ++n) {
    if (!cut.tree.nodes[n].tile.valid()) continue;
    auto& nodes = path[static_cast<std::size_t>(cut.tree.nodes[n].tile.value)];
    for (auto at = static_cast<std::int64_t>(n); at >= 0; at = cut.tree.nodes[static_cast<std::size_t>(at)].parent)
      nodes.insert(nodes.begin(), at);
  }
  for (const FrameEdge& edge : block.edges) {
    const auto a = static_cast<std::size_t>(edge.a.value), b = static_cast<std::size_t>(edge.b.value);
    if (cut.leaf_of_node[a] == cut.leaf_of_node[b]) continue;
    const auto& x = path[static_cast<std::size_t>(cut.leaf_of_node[a])];
    const auto& y = path[static_cast<std::size_t>(cut.leaf_of_node[b])];
    std::int32_t parting = 0;
    while (x[static_cast<std::size_t>(parting) + 1] == y[static_cast<std::size_t>(parting) + 1]) ++parting;
    EXPECT_TRUE((depth[a] >= 0 && depth[a] <= parting) || (depth[b] >= 0 && depth[b] <= parting));
  }
  // At the root two rows of 80, or four columns of 40; the cut of METIS is not quite straight.
  EXPECT_LE(std::count(depth.begin(), depth.end(), 0), 1.15 * 160);
  EXPECT_GE(std::count(depth.begin(), depth.end(), 0), 160);
}

}  // namespace
}  // namespace megablock
