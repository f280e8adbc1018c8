#include "adjust/problem/owner.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

std::int64_t owner(std::vector<OwnerCandidate> frames) { return owner_part(frames); }

TEST(Owner, IsThePartWithMostFramesAndTheLowerOfTwo) {
  EXPECT_EQ(owner({}), -1);
  EXPECT_EQ(owner({{4, -1}}), 4);
  EXPECT_EQ(owner({{1, -1}, {0, -1}, {1, -1}}), 1);
  EXPECT_EQ(owner({{2, -1}, {1, -1}, {1, -1}, {2, -1}}), 1);
}

TEST(Owner, IsAmongThePartsOfFramesThatSeparateTheLeast) {
  EXPECT_EQ(owner({{0, 0}, {0, 0}, {0, 0}, {1, -1}}), 1);  // three frames of the root's separator
  EXPECT_EQ(owner({{0, 1}, {0, 1}, {1, 3}, {2, 0}, {2, 0}, {2, 0}}), 1);
  EXPECT_EQ(owner({{0, 2}, {1, 2}, {1, 2}, {0, 1}, {0, 1}}), 1);
  EXPECT_EQ(owner({{3, 0}, {2, 0}}), 2);
}

}  // namespace
}  // namespace megablock
