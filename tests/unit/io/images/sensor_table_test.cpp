#include "io/images/sensor_table.h"

#include <gtest/gtest.h>

namespace megablock {
namespace {

// Widths from the makers' data sheets, in the spelling of the cameras' own EXIF headers.
TEST(SensorTable, FindsCamerasAsTheirHeadersNameThem) {
  EXPECT_EQ(sensor_width_mm("DJI", "FC6310"), 13.2);
  EXPECT_EQ(sensor_width_mm("NIKON CORPORATION", "NIKON D800"), 35.9);
  EXPECT_EQ(sensor_width_mm("Canon", "Canon EOS 5D Mark III"), 36.0);
  EXPECT_EQ(sensor_width_mm("Canon", "Canon DIGITAL IXUS 50"), 5.75);  // 1/2.5 inch
  EXPECT_EQ(sensor_width_mm("SONY", "DSC-RX100"), 13.2);
  EXPECT_EQ(sensor_width_mm("Apple", "iPhone 6"), 4.89);
  EXPECT_EQ(sensor_width_mm("LG Electronics", "LG-D855"), 4.8);
  EXPECT_EQ(sensor_width_mm("NIKON", "E5700"), 8.8);
  EXPECT_EQ(sensor_width_mm("OLYMPUS IMAGING CORP.", "E-5"), 17.3);  // four thirds
}

TEST(SensorTable, KeepsMakersApart) {
  // A model's name alone is not enough: the table knows a "d70" of Nikon and none of Casio.
  EXPECT_EQ(sensor_width_mm("NIKON CORPORATION", "NIKON D70"), 23.7);
  EXPECT_FALSE(sensor_width_mm("CASIO COMPUTER CO.,LTD.", "D70"));
}

TEST(SensorTable, HasNoWidthForAnUnknownCamera) {
  EXPECT_FALSE(sensor_width_mm("", ""));
  EXPECT_FALSE(sensor_width_mm("Nobody", "Nothing 1"));
  EXPECT_FALSE(sensor_width_mm("Canon", ""));
  EXPECT_FALSE(sensor_width_mm("make", "model"));  // the head of the table is no camera
}

}  // namespace
}  // namespace megablock
