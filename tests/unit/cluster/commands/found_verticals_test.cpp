#include "cluster/commands/found_verticals.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

class FoundVerticalsTest : public testing::Test {
 protected:
  FoundVerticalsTest() : store_(scratch_.path("")) {}
  FoundVerticals file(std::vector<std::uint64_t> keys) const { return {store_, "table.found", std::move(keys)}; }

  ScratchDirectory scratch_;
  JobStore store_;
};

TEST_F(FoundVerticalsTest, KeepsPicturesByKey) {
  FoundVerticals first = file({11, 12, 13});
  EXPECT_EQ(first.count(), 0u);
  first.add(0, {"a b.jpg,1\n", "", true, -0.1, 7});
  first.add(2, {"line\nbreak.jpg,\n", "", false, 0, 0});
  first.add(1, {"c.jpg,\n", "cannot be read", false, 0, 0});  // looked at again next time
  first.save();

  FoundVerticals second = file({13, 99, 11, 12});
  EXPECT_EQ(second.count(), 2u);
  EXPECT_TRUE(second.has(0) && second.has(2));
  second.add(1, {"new.jpg,\n", "", false, 0, 1});
  second.add(3, {"c.jpg,\n", "", false, 0, 1});
  const std::vector<FoundVertical> all = second.all();
  EXPECT_EQ(all[0].row, "line\nbreak.jpg,\n");
  EXPECT_EQ(all[2].row, "a b.jpg,1\n");
  EXPECT_TRUE(all[2].found);
  EXPECT_EQ(all[2].roll, -0.1);
  EXPECT_EQ(all[2].segments, 7);
}

TEST_F(FoundVerticalsTest, ForgetsADamagedFile) {
  FoundVerticals first = file({1});
  first.add(0, {"a.jpg,\n", "", true, 1, 2});
  first.save();
  EXPECT_EQ(file({1}).count(), 1u);
  std::fstream bytes(store_.path("table.found"), std::ios::in | std::ios::out | std::ios::binary);
  bytes.put('9');
  bytes.close();
  EXPECT_EQ(file({1}).count(), 0u);
}

}  // namespace
}  // namespace megablock
