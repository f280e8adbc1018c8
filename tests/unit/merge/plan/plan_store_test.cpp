// Plans on disk are read back as they were written.
#include "merge/plan/plan_store.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "merge/plan/tile_plan.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/damaged_scratch.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

Bytes plan_bytes(const TilePlan& plan) {
  ByteWriter writer;
  plan.write(writer);
  return writer.take();
}

class PlanStoreTest : public testing::Test {
 protected:
  PlanStoreTest() {
    SimulationOptions options;
    options.frames = 90;
    options.points_per_frame = 60;
    const TiledBlock block(simulate_block(options), 30, ObservationOptions(), 0);
    std::vector<UnknownList> unknowns;
    for (const TileProblem& problem : block.problems) unknowns.push_back(tile_unknowns(problem));
    const EliminationPlan tree = make_plan(block.tiles.tree, unknowns);
    for (std::size_t t = 0; t < block.problems.size(); ++t)
      plans.push_back(make_tile_plan(block.problems[t], tree.nodes[at(tree.node_of_leaf[t])], 8));
  }

  ScratchDirectory scratch;
  std::vector<TilePlan> plans;
};

TEST_F(PlanStoreTest, EveryPlanComesBack) {
  for (const bool to_scratch : {false, true}) {
    PlanStore store(std::make_shared<ScratchSpace>(scratch.path()));
    for (std::size_t t = 0; t < plans.size(); ++t) store.add(static_cast<std::int64_t>(t), plans[t], to_scratch);
    EXPECT_EQ(std::filesystem::is_empty(scratch.path()), !to_scratch);
    ASSERT_GE(plans.size(), 3u);
    for (const std::size_t t : {0u, 2u, 2u, 1u, 0u}) {
      EXPECT_EQ(store.in_scratch(t), to_scratch);
      EXPECT_EQ(plan_bytes(store[t]), plan_bytes(plans[t])) << t;
      EXPECT_EQ(store[t].points.size(), plans[t].cells.node_of_leaf.size());
      for (std::size_t cell = 0; cell < plans[t].points.size(); ++cell) {
        EXPECT_EQ(store[t].points[cell].rows(), plans[t].points[cell].rows());
        ASSERT_EQ(store[t].terms[cell].size(), plans[t].terms[cell].size());
        for (std::size_t row = 0; row < plans[t].terms[cell].size(); ++row) {
          EXPECT_EQ(store[t].terms[cell][row].type, plans[t].terms[cell][row].type);
          EXPECT_EQ(store[t].terms[cell][row].row, plans[t].terms[cell][row].row);
        }
      }
      EXPECT_EQ(store[t].unknowns, plans[t].unknowns);
      EXPECT_EQ(store[t].part_of_frame, plans[t].part_of_frame);
      EXPECT_EQ(store[t].cells.nodes.back().eliminated, plans[t].cells.nodes.back().eliminated);
    }
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

// Work on one tile goes on while another is begun: what is in memory stays where it is.
TEST_F(PlanStoreTest, PlansInMemoryStandBesideThoseInScratch) {
  PlanStore store(std::make_shared<ScratchSpace>(scratch.path()));
  for (std::size_t t = 0; t < 3; ++t) store.add(static_cast<std::int64_t>(t), plans[t], t != 1);
  const TilePlan& first = store[0];
  const TilePlan& second = store[1];
  EXPECT_TRUE(store.in_scratch(0));
  EXPECT_FALSE(store.in_scratch(1));
  EXPECT_EQ(plan_bytes(first), plan_bytes(plans[0]));
  store[2];
  EXPECT_EQ(plan_bytes(second), plan_bytes(plans[1]));
}

TEST_F(PlanStoreTest, KeepsWhatHasNoRoomInScratch) {
  const auto size = static_cast<std::int64_t>(plan_bytes(plans[0]).size());
  for (const std::int64_t budget : {size - 1, size}) {
    const auto space = std::make_shared<ScratchSpace>(scratch.path(), budget);
    PlanStore store(space);
    store.add(0, plans[0], true);
    EXPECT_EQ(plan_bytes(store[0]), plan_bytes(plans[0]));
    EXPECT_EQ(store.in_scratch(0), budget == size);
    EXPECT_EQ(space->bytes(), budget == size ? size : 0);
  }
}

TEST_F(PlanStoreTest, NamesAFileThatIsDamaged) {
  PlanStore store(std::make_shared<ScratchSpace>(scratch.path()));
  store.add(7, plans[0], true);
  const std::string file = scratch.path("tile-7-plan.bin");
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);
  expect_named([&] { store[0]; }, file);
}

}  // namespace
}  // namespace megablock
