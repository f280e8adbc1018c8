// Factors between the sweeps are in memory, on disk, or dropped, and are never confused.
#include <gtest/gtest.h>

#include <filesystem>

#include "merge/step/memory.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/damaged_scratch.h"

namespace megablock {
namespace {

class FactorStoreTest : public testing::Test {
 protected:
  std::shared_ptr<ScratchSpace> space() const { return std::make_shared<ScratchSpace>(scratch_.path("rank-0")); }
  ScratchDirectory scratch_;
};

NodeFactors factors_of_size(std::size_t values) {
  NodeFactors factors;
  factors.front.eliminated = {{{UnknownKind::kFrame, 0, 0}, 1}};
  factors.front.separator = {{{UnknownKind::kFrame, 0, 1}, static_cast<std::int64_t>(values) - 1}};
  factors.front.factor.assign(values, 1.5);
  factors.front.z.assign(1, 0.5);
  return factors;
}

TEST_F(FactorStoreTest, FactorsMakeRoomForOthersAndAreDiscarded) {
  FactorStore store({1 << 20, space()});
  for (std::int64_t node = 0; node < 4; ++node) store.put(node, factors_of_size(20000));  // 160 kB each
  EXPECT_EQ(store.statistics().spilled, 0);
  store.leave_room(700 << 10);
  EXPECT_EQ(store.statistics().spilled, 2);
  for (std::int64_t node = 0; node < 4; ++node) {
    ASSERT_NE(store.get(node), nullptr);
    EXPECT_EQ(store.get(node)->front.factor.size(), 20000U);
  }
  store.discard(0);
  store.discard(3);
  EXPECT_EQ(store.get(0), nullptr);
  EXPECT_EQ(store.get(3), nullptr);
  EXPECT_NE(store.get(2), nullptr);
}

TEST_F(FactorStoreTest, NamesAFileThatIsDamaged) {
  FactorStore store({0, space()});
  for (std::int64_t node = 0; node < 3; ++node) store.put(node, factors_of_size(100));
  const std::string file = scratch_.path("rank-0/" + factor_file(1));
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);
  expect_named([&] { store.get(1); }, file);
  ASSERT_NE(store.get(0), nullptr);
}

// What the disk took before it filled comes back, what may not be lost stays in memory, the rest is given up, until the
// next pass tries again.
TEST_F(FactorStoreTest, AFullDiskLosesOnlyWhatCanBeComputedAgain) {
  const auto scratch = space();
  FactorStore store({0, scratch});  // of what is in memory only the newest
  const auto put = [&](std::int64_t node, FactorStore::Loss loss = FactorStore::Loss::kRecompute) {
    store.put(node, factors_of_size(static_cast<std::size_t>(100 + node)), loss);
  };
  put(0);
  put(1);
  {
    const BrokenDisk disk(scratch_.path("rank-0"));
    put(2, FactorStore::Loss::kNever);
    put(3);
    put(4);
    EXPECT_FALSE(store.copy_to_scratch());
  }
  put(5);  // room that comes back is not looked for in the same pass
  EXPECT_EQ(store.statistics().spilled, 1);
  EXPECT_EQ(store.nodes_in_scratch(), std::vector<std::int64_t>{0});
  EXPECT_EQ(scratch->bytes(), scratch->bytes_of(factor_file(0)));
  for (const std::int64_t node : {0, 2, 5}) {
    ASSERT_NE(store.get(node), nullptr) << node;
    EXPECT_EQ(std::ssize(store.get(node)->front.factor), 100 + node);
  }
  for (const std::int64_t node : {1, 3, 4}) EXPECT_EQ(store.get(node), nullptr) << node;
  store.clear();
  for (const std::int64_t node : {0, 1, 2}) put(node);
  EXPECT_EQ(store.nodes_in_scratch(), (std::vector<std::int64_t>{0, 1}));
}

// A pass that leaves other factors than the one before does not add to its files.
TEST_F(FactorStoreTest, FilesOfThePassBeforeGiveWayWithinTheBudget) {
  const std::int64_t file = [&] {
    const auto scratch = space();
    FactorStore store({0, scratch});
    for (std::int64_t node = 0; node < 2; ++node) store.put(node, factors_of_size(1000));
    return scratch->bytes();
  }();
  const auto scratch = std::make_shared<ScratchSpace>(scratch_.path("rank-0"), 2 * file);
  {
    FactorStore store({0, scratch});
    for (const std::int64_t first : {0, 10, 0, 11}) {
      store.clear();
      for (std::int64_t node = first; node < first + 5; ++node) store.put(node, factors_of_size(1000));
      EXPECT_EQ(store.nodes_in_scratch(), (std::vector<std::int64_t>{first, first + 1}));
      EXPECT_EQ(scratch->bytes(), 2 * file);
    }
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch_.path("rank-0")));
}

}  // namespace
}  // namespace megablock
