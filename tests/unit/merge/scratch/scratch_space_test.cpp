// The scratch directory of a rank: its files never exceed the budget, and files can be read back.
#include "merge/scratch/scratch_space.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"
#include "tests/support/merge/damaged_scratch.h"

namespace megablock {
namespace {

class ScratchSpaceTest : public testing::Test {
 protected:
  static bool put(ScratchSpace& space, const std::string& name, const std::string& text) {
    return space.write(name, [&](std::ostream& file) { file << text; });
  }
  static bool put(ScratchSpace& space, const std::string& name, std::size_t bytes) {
    return put(space, name, std::string(bytes, name.front()));
  }
  std::string text(const std::string& name) const { return bytes_of(scratch_.path(name)); }
  bool there(const std::string& name) const { return std::filesystem::exists(scratch_.path(name)); }

  ScratchDirectory scratch_;
};

TEST_F(ScratchSpaceTest, FilesAreWrittenOverAndEndWhereTheyWereWritten) {
  ScratchSpace space(scratch_.path());
  for (const std::string text : {"a long first text", "short", "and a longer one again"}) {
    ASSERT_TRUE(put(space, "file", text));
    EXPECT_EQ(this->text("file"), text);
    EXPECT_EQ(space.bytes(), std::ssize(text));
  }
  EXPECT_FALSE(put(space, "no/such/file", "text"));
  EXPECT_EQ(space.bytes(), space.bytes_of("file"));
}

TEST_F(ScratchSpaceTest, TheBudgetEndsAsADiskDoes) {
  ScratchSpace space(scratch_.path(), 100);
  EXPECT_TRUE(put(space, "a", 60));
  EXPECT_FALSE(put(space, "b", 41));
  EXPECT_FALSE(there("b"));
  EXPECT_TRUE(put(space, "b", 40));
  EXPECT_TRUE(put(space, "a", 60));  // over itself
  EXPECT_FALSE(put(space, "a", 61));
  EXPECT_FALSE(there("a"));
  EXPECT_EQ(space.bytes(), 40);
  EXPECT_TRUE(put(space, "a", 60));
}

// In many pieces, and larger than any buffer: what is on the disk while it is written counts, too.
TEST_F(ScratchSpaceTest, AFileIsNeverMoreThanTheBudget) {
  constexpr std::int64_t kBudget = 100000;
  ScratchSpace space(scratch_.path(), kBudget);
  const bool whole = space.write("file", [&](std::ostream& file) {
    for (int i = 0; i < 300; ++i) {
      file << std::string(1000, 'x');
      file.flush();
      if (there("file")) {
        EXPECT_LE(std::filesystem::file_size(scratch_.path("file")), kBudget) << i;
      }
    }
  });
  EXPECT_FALSE(whole);
  EXPECT_FALSE(there("file"));
  EXPECT_EQ(space.bytes(), 0);
}

TEST_F(ScratchSpaceTest, SpareFilesStayUntilTheirRoomIsNeeded) {
  ScratchSpace space(scratch_.path(), 100);
  for (const std::string name : {"a", "b", "c"}) EXPECT_TRUE(put(space, name, 30));
  space.spare("a");
  space.spare("b");
  EXPECT_TRUE(put(space, "d", 10));
  EXPECT_TRUE(there("a") && there("b"));
  EXPECT_TRUE(put(space, "b", 30));  // needed again
  EXPECT_FALSE(put(space, "e", 31));
  EXPECT_TRUE(put(space, "e", 30));
  EXPECT_FALSE(there("a"));
  EXPECT_EQ(text("b"), std::string(30, 'b'));
  EXPECT_EQ(text("c"), std::string(30, 'c'));
  space.spare("c");
  EXPECT_FALSE(space.reserve("f", 31));
  EXPECT_TRUE(there("c"));  // it would not have been enough
}

TEST_F(ScratchSpaceTest, ReservedBytesAreNobodyElses) {
  ScratchSpace space(scratch_.path(), 100);
  EXPECT_TRUE(space.reserve("a", 60));
  EXPECT_EQ(space.bytes(), 60);
  EXPECT_FALSE(put(space, "b", 41));
  EXPECT_TRUE(put(space, "a", 60));
  EXPECT_TRUE(put(space, "a", 20));  // the rest is free again
  EXPECT_TRUE(put(space, "b", 80));
  EXPECT_FALSE(space.reserve("a", 21));
  EXPECT_FALSE(there("a"));
  space.remove("b");
  EXPECT_EQ(space.bytes(), 0);
}

TEST_F(ScratchSpaceTest, AFileThatIsNotWhatWasWrittenIsNamedAndGone) {
  ScratchSpace space(scratch_.path());
  const auto read = [&] {
    std::string found(20, ' ');
    space.read("file", [&](std::istream& file, std::size_t) { file.read(found.data(), 20); });
    return found;
  };
  for (const std::size_t bytes : {19U, 20U, 21U}) {
    EXPECT_TRUE(put(space, "file", 20));
    std::filesystem::resize_file(scratch_.path("file"), bytes);
    if (bytes == 20) {
      EXPECT_EQ(read(), std::string(20, 'f'));
      continue;
    }
    expect_named([&] { read(); }, scratch_.path("file"));
    EXPECT_FALSE(there("file"));
    EXPECT_EQ(space.bytes(), 0);
  }
  expect_named([&] { read(); }, scratch_.path("file"));
}

TEST_F(ScratchSpaceTest, RenamedFilesTakeThePlaceOfOthers) {
  ScratchSpace space(scratch_.path(), 100);
  EXPECT_TRUE(put(space, "a", 30) && put(space, "b", 50));
  EXPECT_TRUE(space.rename("b", "a"));
  EXPECT_EQ(space.bytes(), 50);
  EXPECT_EQ(text("a"), std::string(50, 'b'));
  EXPECT_FALSE(space.rename("b", "a"));
  EXPECT_EQ(space.bytes(), 50);
}

TEST_F(ScratchSpaceTest, WhatAnEarlierRunLeftCounts) {
  std::ofstream(scratch_.path("a")) << std::string(60, 'a');
  std::ofstream(scratch_.path("b")) << std::string(70, 'b');
  ScratchSpace space(scratch_.path(), 100);
  EXPECT_EQ(space.bytes(), 130);
  EXPECT_FALSE(put(space, "c", 1));
  space.keep_only({"a"});
  EXPECT_FALSE(there("b"));
  EXPECT_EQ(text("a"), std::string(60, 'a'));
  EXPECT_FALSE(put(space, "c", 41));
  EXPECT_TRUE(put(space, "c", 40));
}

TEST_F(ScratchSpaceTest, NowhereTakesNothing) {
  ScratchSpace space;
  EXPECT_FALSE(put(space, "a", ""));
  EXPECT_FALSE(space.reserve("a", 1));
  space.remove("a");
  EXPECT_EQ(space.bytes(), 0);
}

TEST_F(ScratchSpaceTest, ADirectoryThatCannotBeMadeIsRefused) {
  EXPECT_THROW(ScratchSpace("/proc/no/such/folder"), InputError);
}

}  // namespace
}  // namespace megablock
