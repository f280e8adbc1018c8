#include "merge/plan/plan.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "merge/tile/condense.h"
#include "partition/tiles/separators.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

bool among(const UnknownList& list, const Unknown& u) { return std::binary_search(list.begin(), list.end(), u); }

// What adjust/problem/owner.h promises: the points of two sides of a node have only those frames in common that
// separate the node or one further up.
TEST(Plan, SidesOfANodeShareTheFramesOfSeparatorsOnly) {
  SimulationOptions options;
  options.frames = 240;
  options.points_per_frame = 80;
  options.calibrate = false;
  const TiledBlock block(simulate_block(options), 30, {}, 0);
  ASSERT_GE(block.problems.size(), 8u);
  std::vector<UnknownList> leaves;
  for (const TileProblem& problem : block.problems) leaves.push_back(tile_unknowns(problem));
  const EliminationPlan plan = make_plan(block.tiles.tree, leaves);
  const std::vector<std::int32_t> depth = depths(block.tiles.tree);
  std::int64_t shared = 0;
  for (std::size_t n = 0; n < plan.nodes.size(); ++n) {
    if (plan.nodes[n].leaf >= 0) continue;
    const auto side = [&](std::int64_t child) -> const UnknownList& {
      return plan.nodes[static_cast<std::size_t>(child)].separator;
    };
    for (const Unknown& u : side(plan.nodes[n].left)) {
      if (!among(side(plan.nodes[n].right), u)) continue;
      ++shared;
      const std::int32_t separates = block.tiles.depth_of(FrameIndex(u.id.index));
      EXPECT_GE(separates, 0) << u.id.index;
      EXPECT_LE(separates, depth[n]) << u.id.index;
    }
  }
  EXPECT_GT(shared, 50);
}

Bytes written_plan(const EliminationPlan& plan) {
  ByteWriter out;
  plan.write(out);
  return out.take();
}

TEST(Plan, DamagedOnesAreRefused) {
  EliminationPlan whole;
  whole.nodes.resize(3);
  for (std::size_t leaf = 0; leaf < 2; ++leaf) {
    whole.nodes[leaf].parent = 2;
    whole.nodes[leaf].leaf = static_cast<std::int64_t>(leaf);
  }
  whole.nodes[2].left = 0;
  whole.nodes[2].right = 1;
  whole.node_of_leaf = {0, 1};
  const auto back = [](const Bytes& bytes) {
    ByteReader in(bytes);
    return EliminationPlan::read(in);
  };
  EXPECT_EQ(written_plan(back(written_plan(whole))), written_plan(whole));
  for (const std::int64_t wrong : {std::int64_t{-2}, std::int64_t{3}, std::int64_t{1} << 60}) {
    for (std::int64_t PlanNode::*number : {&PlanNode::left, &PlanNode::right, &PlanNode::parent, &PlanNode::leaf}) {
      EliminationPlan plan = whole;
      plan.nodes[1].*number = wrong;
      EXPECT_THROW(back(written_plan(plan)), StoreError);
    }
    EliminationPlan plan = whole;
    plan.node_of_leaf[1] = wrong;
    EXPECT_THROW(back(written_plan(plan)), StoreError);
  }
  // Every byte of the sizes may be damaged: the number of nodes comes first.
  for (std::size_t place = 0; place < sizeof(std::uint64_t); ++place) {
    Bytes bytes = written_plan(whole);
    bytes[place] = '\x7f';
    EXPECT_THROW(back(bytes), StoreError) << place;
  }
}

}  // namespace
}  // namespace megablock
