#include "io/images/image_header.h"

#include <gmock/gmock.h>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::dms;
using fixture::gps_tags;
using fixture::joined;
using fixture::message_of;
using fixture::Tags;
using fixture::write_file;
using fixture::write_image_file;
using ::testing::HasSubstr;

TEST(ImageHeader, ReadsCameraTimeAndPosition) {
  ScratchDirectory folder;
  Tags tags = gps_tags(-33.8567844, -151.2152967, -12.5);
  tags = joined(tags, {{"Exif.Image.Make", "DJI"},
                       {"Exif.Image.Model", "FC300S"},
                       {"Exif.Photo.FocalLength", "361/100"},
                       {"Exif.Photo.FocalLengthIn35mmFilm", "20"},
                       {"Exif.Photo.DateTimeOriginal", "2016:06:23 16:31:59"},
                       {"Exif.Photo.SubSecTimeOriginal", "25"},
                       {"Exif.Image.Orientation", "6"},
                       {"Exif.GPSInfo.GPSDOP", "14/10"},
                       {"Xmp.drone-dji.GimbalYawDegree", "+45.00"},
                       {"Xmp.drone-dji.GimbalPitchDegree", "-89.90"},
                       {"Xmp.drone-dji.GimbalRollDegree", "+0.50"},
                       {"Xmp.drone-dji.RtkStdLon", "0.012"},
                       {"Xmp.drone-dji.RtkStdLat", "0.014"},
                       {"Xmp.drone-dji.RtkStdHgt", "0.031"}});
  write_image_file(folder.path("a.jpg"), 64, 48, 1, tags);
  const ImageHeader header = read_image_header(folder.path("a.jpg"));
  EXPECT_EQ(header.width, 64);
  EXPECT_EQ(header.height, 48);
  EXPECT_EQ(header.model, "FC300S");
  EXPECT_EQ(header.orientation, 6);
  EXPECT_DOUBLE_EQ(header.focal_mm, 3.61);
  EXPECT_DOUBLE_EQ(header.time_s, 1466699519.25);  // date -u -d '2016-06-23 16:31:59' +%s
  ASSERT_TRUE(header.position);
  EXPECT_NEAR(header.position->latitude_deg, -33.8567844, 1e-9);
  EXPECT_NEAR(header.position->longitude_deg, -151.2152967, 1e-9);
  EXPECT_DOUBLE_EQ(header.position->height_m, -12.5);
  EXPECT_DOUBLE_EQ(header.dop, 1.4);
  EXPECT_DOUBLE_EQ(header.position_sigma_horizontal_m, 0.014);
  EXPECT_DOUBLE_EQ(header.position_sigma_vertical_m, 0.031);
  ASSERT_TRUE(header.attitude);
  EXPECT_LT(rotation_angle(header.attitude->rotation,
                           rotation_from(YawPitchRoll{45 * kDegree, -89.9 * kDegree, 0.5 * kDegree})),
            1e-12);
}

TEST(ImageHeader, ReadsTheTimesOfReceiverAndZone) {
  ScratchDirectory folder;
  write_image_file(folder.path("a.jpg"), 64, 48, 1,
                   {{"Exif.GPSInfo.GPSDateStamp", "2021:06:01"},
                    {"Exif.GPSInfo.GPSTimeStamp", "10/1 20/1 3025/100"},
                    {"Exif.Photo.DateTimeOriginal", "2021:06:01 12:20:31"},
                    {"Exif.Photo.0x9011", "+02:00"}});
  const ImageHeader header = read_image_header(folder.path("a.jpg"));
  EXPECT_DOUBLE_EQ(header.gps_time_s, 1622542830.25);  // date -u -d '2021-06-01 10:20:30' +%s
  EXPECT_DOUBLE_EQ(header.time_s - header.zone_s, 1622542831);
  write_image_file(folder.path("b.jpg"), 64, 48, 1, {{"Exif.GPSInfo.GPSDateStamp", "2021:13:01"}});
  EXPECT_TRUE(std::isnan(read_image_header(folder.path("b.jpg")).gps_time_s));
}

TEST(ImageHeader, FocalLengthByEachWay) {
  ImageHeader header;
  header.width = 1800;
  header.height = 1350;
  EXPECT_FALSE(focal_px(header));
  header.focal_35mm = 20;
  EXPECT_DOUBLE_EQ(*focal_px(header), 1000);
  header.focal_mm = 4.3;
  header.make = "Canon";
  header.model = "Canon PowerShot ELPH 300 HS";
  EXPECT_DOUBLE_EQ(*focal_px(header), 4.3 / 6.17 * 1800);
  header.sensor_width_mm = 6.2;
  EXPECT_DOUBLE_EQ(*focal_px(header), 4.3 / 6.2 * 1800);
  header.width = 1350;  // upright: the larger side counts
  header.height = 1800;
  EXPECT_DOUBLE_EQ(*focal_px(header), 4.3 / 6.2 * 1800);
}

TEST(ImageHeader, FocalPlaneResolutionRefersToTheImageAsTaken) {
  ScratchDirectory folder;
  const Tags tags = {{"Exif.Photo.FocalLength", "43/10"},
                     {"Exif.Photo.FocalPlaneXResolution", "4000000/244"},
                     {"Exif.Photo.FocalPlaneResolutionUnit", "2"},
                     {"Exif.Photo.PixelXDimension", "4000"},
                     {"Exif.Photo.PixelYDimension", "3000"}};
  write_image_file(folder.path("reduced.jpg"), 180, 135, 1, tags);
  const ImageHeader header = read_image_header(folder.path("reduced.jpg"));
  EXPECT_NEAR(header.sensor_width_mm, 0.244 * 25.4, 1e-9);
  EXPECT_NEAR(*focal_px(header), 4.3 / (0.244 * 25.4) * 180, 1e-9);
}

TEST(ImageHeader, AnImageWithoutTagsHasOnlyItsSize) {
  ScratchDirectory folder;
  for (const char* name : {"a.jpg", "a.png", "a.tif"}) {
    write_image_file(folder.path(name), 40, 30, 7);
    const ImageHeader header = read_image_header(folder.path(name));
    EXPECT_EQ(header.width, 40) << name;
    EXPECT_EQ(header.height, 30) << name;
    EXPECT_FALSE(header.position);
    EXPECT_FALSE(header.attitude);
    EXPECT_TRUE(std::isnan(header.time_s));
    EXPECT_FALSE(focal_px(header));
  }
}

TEST(ImageHeader, NonsenseInTagsIsAbsence) {
  ScratchDirectory folder;
  Tags tags = gps_tags(10, 20, 30);
  tags["Exif.GPSInfo.GPSLatitude"] = "1/0 0/0 0/0";
  tags["Exif.Photo.DateTimeOriginal"] = "0000:00:00 00:00:00";
  tags["Exif.Photo.FocalLength"] = "0/0";
  tags["Xmp.drone-dji.GimbalYawDegree"] = "unknown";
  write_image_file(folder.path("a.jpg"), 40, 30, 7, tags);
  const ImageHeader header = read_image_header(folder.path("a.jpg"));
  EXPECT_FALSE(header.position);
  EXPECT_TRUE(std::isnan(header.time_s));
  EXPECT_FALSE(focal_px(header));
  EXPECT_FALSE(header.attitude);
}

TEST(ImageHeader, BadFilesGiveAReason) {
  ScratchDirectory folder;
  write_file(folder.path("empty.jpg"), "");
  write_file(folder.path("text.jpg"), "this is no image, only words that go on for a while");
  write_image_file(folder.path("good.jpg"), 400, 300, 7, gps_tags(1, 2, 3));
  write_file(folder.path("cut.jpg"), fixture::read_file(folder.path("good.jpg")).substr(0, 90));
  const auto reason = [&](const std::string& name) {
    return message_of<InputError>([&] { read_image_header(folder.path(name)); });
  };
  EXPECT_THAT(reason("empty.jpg"), HasSubstr("empty"));
  EXPECT_NE(reason("text.jpg"), "");
  EXPECT_NE(reason("cut.jpg"), "");
  EXPECT_THAT(reason("missing.jpg"), HasSubstr("No such file"));
}

}  // namespace
}  // namespace megablock
