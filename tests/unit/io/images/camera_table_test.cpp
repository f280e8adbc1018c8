#include "io/images/camera_table.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

constexpr std::string_view kTable =
    "# figures\n"
    "make,model,figure,fewest_megapixels\n"
    ",fc330,33,0\n"
    "maker,x1,5\n"
    "other,x1,6\n"
    ",l1d,47,0\n"
    ",l1d,56,17\n";

TEST(CameraTable, ComparesLettersAndDigitsAlone) {
  const CameraTable table(kTable);
  EXPECT_EQ(table.find("DJI", "FC330"), 33);
  EXPECT_EQ(table.find("DJI", "dji fc-330"), 33);
  EXPECT_EQ(table.find("MAKER CORPORATION", "X 1"), 5);
  EXPECT_EQ(table.find("Other", "Other X1"), 6);
  EXPECT_FALSE(table.find("Third", "X1"));
  EXPECT_FALSE(table.find("", ""));
}

TEST(CameraTable, TakesTheLineForTheMostMegapixelsThatTheImageHas) {
  const CameraTable table(kTable);
  EXPECT_EQ(table.find("", "L1D", 16.8), 47);
  EXPECT_EQ(table.find("", "L1D", 20), 56);
  EXPECT_EQ(table.find("", "L1D"), 56);
}

}  // namespace
}  // namespace megablock
