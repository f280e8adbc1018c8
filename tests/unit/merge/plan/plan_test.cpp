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

}  // namespace
}  // namespace megablock
