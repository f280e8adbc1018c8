#include "io/project/inputs/lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/store/units/block_file.h"
#include "tests/support/io/example_block.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using ::testing::HasSubstr;

class LinesFile : public ::testing::Test {
 protected:
  std::string message(const std::string& rows) {
    try {
      read(rows);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  Block read(const std::string& rows) {
    fixture::write_file(scratch_.path("lines.csv"),
                        "name,direction,image,column1_px,row1_px,column2_px,row2_px,sigma_px\n" + rows);
    Block block = block_;
    read_lines(scratch_.path("lines.csv"), {"gone.jpg"}, block, warnings_);
    return block;
  }
  std::string image(std::size_t i) const { return block_.name_of(ImageIndex(static_cast<std::int64_t>(i))); }

  ScratchDirectory scratch_;
  Block block_ = example_block();
  std::vector<std::string> warnings_;
};

TEST_F(LinesFile, IsReadAndKeptInTheBlock) {
  const Block block =
      read("edge,vertical," + image(0) + ",10,10,12,200,0.7\nsill,horizontal," + image(0) +
           ",5,5,90,8,\nsill,horizontal," + image(1) + ",5,15,90,18,\nedge,vertical,gone.jpg,1,1,1,90,\n");
  ASSERT_EQ(block.lines.size(), 2u);
  EXPECT_EQ(block.lines[0].measurements.size(), 1u);
  EXPECT_EQ(block.lines[0].measurements[0].second, Eigen::Vector2d(12, 200));
  EXPECT_EQ(block.lines[0].measurements[0].sigma_px, 0.7);
  EXPECT_EQ(block.lines[1].direction, KnownLine::Direction::kHorizontal);
  EXPECT_EQ(block.lines[1].measurements[1].image, ImageIndex(1));
  EXPECT_EQ(block.lines[1].measurements[1].sigma_px, 1);
  ASSERT_EQ(warnings_.size(), 1u);
  EXPECT_THAT(warnings_[0], HasSubstr("lines.csv:5"));

  write_block(scratch_.path("block.h5"), block);
  const Block again = read_block(scratch_.path("block.h5"));
  ASSERT_EQ(again.lines.size(), 2u);
  EXPECT_EQ(again.lines[1].name, "sill");
  EXPECT_EQ(again.lines[1].measurements[1].first, block.lines[1].measurements[1].first);
  EXPECT_EQ(again.lines[0].measurements[0].sigma_px, 0.7);
}

TEST_F(LinesFile, BadRowsAreNamed) {
  EXPECT_THAT(message("a,upright," + image(0) + ",1,1,1,90,\n"), HasSubstr("lines.csv:2: direction: 'upright'"));
  EXPECT_THAT(message("a,vertical,nowhere.jpg,1,1,1,90,\n"), HasSubstr("nowhere.jpg"));
  EXPECT_THAT(message("a,vertical," + image(0) + ",1,1,1,5,\n"), HasSubstr("less than 10 px"));
  EXPECT_THAT(message("a,vertical," + image(0) + ",7,9,7,9,\n"), HasSubstr("less than 10 px")) << "no direction";
  EXPECT_THAT(message("a,vertical," + image(0) + ",1,1,1,nan,\n"), HasSubstr("lines.csv:2"));
  EXPECT_THAT(message("a,vertical," + image(0) + ",1,1,1,99999,\n"), HasSubstr("outside the image"));
  EXPECT_THAT(message("a,vertical," + image(0) + ",1,1,1,90,0\n"), HasSubstr("sigma_px"));
  EXPECT_THAT(message("a,vertical," + image(0) + ",1,1,1,90,\na,horizontal," + image(1) + ",1,1,90,1,\n"),
              HasSubstr("another direction than in"));
  EXPECT_THAT(message("a,vertical," + image(0) + ",1,1,1,90,\na,vertical," + image(0) + ",1,1,1,90,\n"),
              HasSubstr("twice"));
}

}  // namespace
}  // namespace megablock
