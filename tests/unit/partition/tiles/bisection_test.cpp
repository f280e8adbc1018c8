// Bisection of artificial graphs: size of separators, balance, limits of leaves, and extreme graphs.
#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "io/base/error.h"
#include "partition/tiles/tiles.h"
#include "tests/support/partition/frame_graphs.h"

namespace megablock {
namespace {

// Number of frames on the root's separator: those with links across the two halves.
std::int64_t root_separator(const FrameGraph& graph, const BisectionTree& cut) {
  const MergeTree::Node& root = cut.tree.nodes.back();
  std::int64_t first_right = 0;  // leaves are numbered in tree order, so the left half has the lower numbers
  for (std::int64_t n = 0; n <= root.left; ++n) first_right += cut.tree.nodes[static_cast<std::size_t>(n)].tile.valid();
  std::set<std::int64_t> left, right;
  for (const FrameEdge& edge : graph.edges) {
    const bool a = cut.leaf_of_node[static_cast<std::size_t>(edge.a.value)] < first_right;
    const bool b = cut.leaf_of_node[static_cast<std::size_t>(edge.b.value)] < first_right;
    if (a == b) continue;
    (a ? left : right).insert(edge.a.value);
    (b ? left : right).insert(edge.b.value);
  }
  return static_cast<std::int64_t>(std::min(left.size(), right.size()));
}

TEST(Bisect, SeparatorOfAGridIsAboutOneRow) {
  const FrameGraph graph = sorted(60 * 40, grid(60, 40));
  const BisectionTree cut = bisect(graph, 1300);
  ASSERT_EQ(cut.tree.nodes.size(), 3u);
  EXPECT_LE(root_separator(graph, cut), 44);  // a straight cut has 40
}

TEST(Bisect, HalvesAreBalanced) {
  const FrameGraph graph = sorted(50 * 64, grid(50, 64));
  const BisectionTree cut = bisect(graph, 430);
  std::map<std::int32_t, int> size;
  for (std::int32_t leaf : cut.leaf_of_node) ++size[leaf];
  ASSERT_EQ(size.size(), 8u);
  for (const auto& [leaf, count] : size) EXPECT_NEAR(count, 400, 40);
  expect_tree(cut.tree, 8);
}

TEST(Bisect, KeepsTheLimitDownToSmallLeaves) {
  const FrameGraph graph = sorted(23 * 31, grid(23, 31));
  for (std::int64_t limit : {1, 2, 7, 32, 100, 712, 713}) {
    const BisectionTree cut = bisect(graph, limit);
    std::map<std::int32_t, std::int64_t> size;
    for (std::int32_t leaf : cut.leaf_of_node) ++size[leaf];
    for (const auto& [leaf, count] : size) EXPECT_LE(count, limit);
    expect_tree(cut.tree, static_cast<std::int64_t>(size.size()));
  }
}

TEST(Bisect, GraphsWithoutLinksStarsAndEmptyOnes) {
  EXPECT_TRUE(bisect({0, {}}, 5).tree.nodes.empty());
  EXPECT_EQ(bisect({1, {}}, 5).leaf_of_node, std::vector<std::int32_t>{0});
  expect_tree(bisect({100, {}}, 10).tree, 11);  // planned 5 % below the limit
  std::vector<FrameEdge> star;
  for (int leaf = 1; leaf < 500; ++leaf) add(star, 0, leaf, 20);
  const BisectionTree cut = bisect(sorted(500, star), 50);
  std::map<std::int32_t, int> size;
  for (std::int32_t leaf : cut.leaf_of_node) ++size[leaf];
  for (const auto& [leaf, count] : size) EXPECT_LE(count, 50);
  EXPECT_LT(size.size(), 40u);
}

// Halves in one piece would be one arm against two.
TEST(Bisect, ThreeArmsAtAHubStayBalanced) {
  constexpr std::int64_t kArm = 100;
  std::vector<FrameEdge> edges;
  for (std::int64_t arm = 0; arm < 3; ++arm) {
    const std::int64_t first = 1 + arm * kArm;
    add(edges, 0, first, 100);
    for (std::int64_t f = first; f + 1 < first + kArm; ++f) add(edges, f, f + 1, 100);
  }
  const BisectionTree cut = bisect(sorted(1 + 3 * kArm, edges), 160);
  std::map<std::int32_t, int> size;
  for (const std::int32_t leaf : cut.leaf_of_node) ++size[leaf];
  for (const auto& [leaf, frames] : size) EXPECT_GE(frames, 75) << leaf;
}

TEST(Bisect, RefusesWhatMetisCannotNumber) {
  EXPECT_THROW(bisect({std::int64_t{1} << 31, {}}, 500), ComputeError);
  EXPECT_THROW(bisect({10, {}}, 0), InputError);
}

TEST(Bisect, HugeWeightsDoNotOverflow) {
  std::vector<FrameEdge> edges = grid(20, 20, 0, std::int64_t{1} << 40);
  const FrameGraph graph = sorted(400, edges);
  const BisectionTree cut = bisect(graph, 250);
  EXPECT_LE(root_separator(graph, cut), 24);
}

}  // namespace
}  // namespace megablock
