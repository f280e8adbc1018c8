// Factors between the passes: in memory, in scratch or given up, and never another one's.
#include <gtest/gtest.h>

#include <filesystem>

#include "merge/memory.h"
#include "tests/unit/io/scratch_directory.h"
#include "tests/unit/merge/damaged_scratch.h"

namespace megablock {
namespace {

class FactorStoreTest : public testing::Test {
 protected:
  std::shared_ptr<ScratchSpace> space() const { return std::make_shared<ScratchSpace>(scratch_.path("rank-0")); }
  ScratchDirectory scratch_;
};

NodeFactors factors_of_size(std::size_t values) {
  NodeFactors factors;
  factors.front.factor.assign(values, 1.5);
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

}  // namespace
}  // namespace megablock
