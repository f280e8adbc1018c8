// Headers as the makers of drones write them: XMP packets with the names, forms and conventions of real files.
#include "io/images/header_pose.h"

#include <gmock/gmock.h>

#include "geometry/numbers/angles.h"
#include "geometry/transform/body_attitude.h"
#include "geometry/transform/rotation.h"
#include "io/images/header_fields.h"
#include "tests/support/io/image_files.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using fixture::gps_tags;
using fixture::joined;
using fixture::Tags;

class HeaderPose : public ::testing::Test {
 protected:
  // `spaces`: declarations of namespaces and properties in the short form; `properties`: in the long form.
  ImageHeader header_of(const std::string& spaces, const std::string& properties, const Tags& tags = {}) {
    const std::string path = folder_.path(std::to_string(files_++) + ".jpg");
    fixture::write_image_file(path, 64, 48, 1, tags);
    auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    image->setXmpPacket(
        "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?><x:xmpmeta xmlns:x=\"adobe:ns:meta/\">"
        "<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\"><rdf:Description rdf:about=\"\" " +
        spaces + ">" + properties + "</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end=\"w\"?>");
    image->writeXmpFromPacket(true);
    image->writeMetadata();
    return read_image_header(path);
  }

  // The direction in which the camera looks, and that of the top of the image: east, north, up.
  static Eigen::Vector3d view(const ImageHeader& header) {
    return header.attitude->rotation.conjugate() * Eigen::Vector3d::UnitZ();
  }
  static Eigen::Vector3d top(const ImageHeader& header) {
    return header.attitude->rotation.conjugate() * -Eigen::Vector3d::UnitY();
  }

  ScratchDirectory folder_;
  int files_ = 0;
};

const Eigen::Vector3d kEastward(1, 0, 0), kNorthward(0, 1, 0), kDownward(0, 0, -1);
const std::string kDjiSpace = "xmlns:drone-dji=\"http://www.dji.com/drone-dji/1.0/\" ";
const std::string kPix4dSpace = "xmlns:Camera=\"http://pix4d.com/camera/1.0\" ";

TEST_F(HeaderPose, DjiWithRtk) {
  const ImageHeader header = header_of(
      kDjiSpace +
          "drone-dji:GpsLatitude=\"+46.842608333\" drone-dji:GpsLongtitude=\"-91.994561111\" "
          "drone-dji:AbsoluteAltitude=\"+198.31\" drone-dji:RelativeAltitude=\"+39.80\" "
          "drone-dji:GimbalRollDegree=\"+0.00\" drone-dji:GimbalYawDegree=\"+90.00\" "
          "drone-dji:GimbalPitchDegree=\"-90.00\" drone-dji:FlightRollDegree=\"+3.00\" "
          "drone-dji:FlightYawDegree=\"+46.00\" drone-dji:FlightPitchDegree=\"+1.80\" drone-dji:RtkFlag=\"50\" "
          "drone-dji:RtkStdLon=\"0.01170\" drone-dji:RtkStdLat=\"0.01320\" drone-dji:RtkStdHgt=\"0.02870\"",
      "");
  ASSERT_TRUE(header.position);
  EXPECT_DOUBLE_EQ(header.position->latitude_deg, 46.842608333);
  EXPECT_DOUBLE_EQ(header.position->longitude_deg, -91.994561111);
  EXPECT_DOUBLE_EQ(header.position->height_m, 198.31) << "not the height above the take-off";
  EXPECT_EQ(header.position_source, "XMP (drone-dji)");
  EXPECT_EQ(header.fix, ImageHeader::Fix::kFixed);
  EXPECT_DOUBLE_EQ(header.position_sigma_horizontal_m, 0.0132);
  EXPECT_DOUBLE_EQ(header.position_sigma_vertical_m, 0.0287);
  ASSERT_TRUE(header.attitude);
  EXPECT_LT((view(header) - kDownward).norm(), 1e-12);
  EXPECT_LT((top(header) - kEastward).norm(), 1e-12) << "not the heading of the flight";
}

TEST_F(HeaderPose, DjiOfEveryFamilySpellsThePosition) {
  for (const char* names : {"drone-dji:GpsLatitude=\"10.5\" drone-dji:GpsLongtitude=\"20.25\"",
                            "drone-dji:GpsLatitude=\"10.5\" drone-dji:GpsLongitude=\"20.25\"",
                            "drone-dji:Latitude=\"10.5\" drone-dji:Longitude=\"20.25\""}) {
    const ImageHeader header = header_of(kDjiSpace + names, "");
    ASSERT_TRUE(header.position) << names;
    EXPECT_EQ(header.position->latitude_deg, 10.5) << names;
    EXPECT_EQ(header.position->longitude_deg, 20.25) << names;
    EXPECT_TRUE(std::isnan(header.position->height_m)) << names;
  }
}

TEST_F(HeaderPose, ExifCountsBeforeXmpAndTheFlagSetsTheSigmas) {
  const auto with = [&](const std::string& more, const Tags& tags = {}) {
    return header_of(kDjiSpace + "drone-dji:GpsLatitude=\"1\" drone-dji:GpsLongitude=\"2\" " + more, "",
                     joined(gps_tags(46.84, -91.99, 250), tags));
  };
  const ImageHeader plain = with("");
  EXPECT_NEAR(plain.position->latitude_deg, 46.84, 1e-9);
  EXPECT_EQ(plain.position_source, "EXIF");
  EXPECT_EQ(plain.fix, ImageHeader::Fix::kUnstated);
  EXPECT_TRUE(std::isnan(plain.position_sigma_horizontal_m));
  const ImageHeader fixed = with("drone-dji:RtkFlag=\"50\"");
  EXPECT_EQ(fixed.position_sigma_horizontal_m, 0.03);
  EXPECT_EQ(fixed.position_sigma_vertical_m, 0.06);
  const ImageHeader floating = with("drone-dji:RtkFlag=\"34\"");
  EXPECT_EQ(floating.fix, ImageHeader::Fix::kFloat);
  EXPECT_EQ(floating.position_sigma_horizontal_m, 0.5);
  EXPECT_EQ(floating.position_sigma_vertical_m, 1);
  const ImageHeader single = with("drone-dji:RtkFlag=\"16\"", {{"Exif.GPSInfo.0x001f", "45/10"}});
  EXPECT_EQ(single.fix, ImageHeader::Fix::kSingle);
  EXPECT_EQ(single.position_sigma_horizontal_m, 4.5);
  EXPECT_EQ(with("", {{"Exif.GPSInfo.GPSImgDirection", "17325/100"}}).compass_deg, 173.25);
}

// Anafi: degrees in elements, of the camera; accuracies in Pix4D's namespace.
TEST_F(HeaderPose, Parrot) {
  const ImageHeader header =
      header_of("xmlns:drone-parrot=\"http://www.parrot.com/drone-parrot/1.0/\" " + kPix4dSpace,
                "<drone-parrot:CameraRollDegree>0.000000</drone-parrot:CameraRollDegree>"
                "<drone-parrot:CameraPitchDegree>-45.000000</drone-parrot:CameraPitchDegree>"
                "<drone-parrot:CameraYawDegree>0.000000</drone-parrot:CameraYawDegree>"
                "<drone-parrot:DroneYawDegree>91.5</drone-parrot:DroneYawDegree>"
                "<Camera:AboveGroundAltitude>31.5</Camera:AboveGroundAltitude>"
                "<Camera:GPSXYAccuracy>1.25</Camera:GPSXYAccuracy><Camera:GPSZAccuracy>5/2</Camera:GPSZAccuracy>",
                gps_tags(48.88, 2.37, 60));
  ASSERT_TRUE(header.attitude);
  EXPECT_EQ(header.attitude->source, "XMP (drone-parrot)");
  EXPECT_LT((view(header) - (kNorthward + kDownward).normalized()).norm(), 1e-12);
  EXPECT_EQ(header.position_sigma_horizontal_m, 1.25);
  EXPECT_EQ(header.position_sigma_vertical_m, 2.5);
}

// Pix4D's own examples: 0, 0, 0 is nadir with the top to the north; 0, 90, 0 looks north; 90, 0, 0 has the top east.
TEST_F(HeaderPose, Pix4dAngles) {
  const auto of = [&](const std::string& yaw, const std::string& pitch, const std::string& roll,
                      const std::string& make = "SONY") {
    return header_of(kPix4dSpace,
                     "<Camera:Yaw>" + yaw + "</Camera:Yaw><Camera:Pitch>" + pitch + "</Camera:Pitch><Camera:Roll>" +
                         roll + "</Camera:Roll>",
                     {{"Exif.Image.Make", make}, {"Exif.Image.Model", "DSC-RX1RM2"}});
  };
  EXPECT_LT((view(of("0", "0", "0")) - kDownward).norm(), 1e-12);
  EXPECT_LT((top(of("0", "0", "0")) - kNorthward).norm(), 1e-12);
  EXPECT_LT((view(of("0", "90", "0")) - kNorthward).norm(), 1e-12);
  EXPECT_LT((top(of("90", "0", "0")) - kEastward).norm(), 1e-12);
  // Right wing down: the camera looks to the left of the flight, here to the west.
  EXPECT_LT((view(of("0", "0", "10")) - Eigen::Vector3d(-std::sin(10 * kDegree), 0, -std::cos(10 * kDegree))).norm(),
            1e-12);
  EXPECT_LT((view(of("0", "0", "10", "senseFly")) - view(of("0", "0", "-10"))).norm(), 1e-12);
  EXPECT_LT((view(of("30", "-89.5", "0")) - kDownward).norm(), 0.01) << "the angles of a gimbal in this namespace";
  EXPECT_EQ(of("0", "0", "0").attitude->source, "XMP (Camera)");
}

// eBee: the same names in a namespace of its own, and accuracies. The parser gives the second namespace of one prefix
// another prefix, whichever file comes first.
TEST_F(HeaderPose, SenseFlyHasItsOwnNamespace) {
  const auto of = [&](const char* space) {
    return header_of(std::string("xmlns:Camera=\"") + space +
                         "\" Camera:Yaw=\"90\" Camera:Pitch=\"5\" Camera:Roll=\"0\" Camera:GPSXYAccuracy=\"0.02\" "
                         "Camera:GPSZAccuracy=\"0.03\"",
                     "", gps_tags(46.5, 6.5, 500));
  };
  for (const char* space :
       {"http://pix4d.com/camera/1.0", "http://ns.sensefly.com/Camera/1.0/", "http://pix4d.com/camera/1.0/"}) {
    const ImageHeader header = of(space);
    ASSERT_TRUE(header.attitude) << space;
    EXPECT_NEAR(view(header).dot(kEastward), std::sin(5 * kDegree), 1e-12) << space;
    EXPECT_EQ(header.position_sigma_horizontal_m, 0.02) << space;
  }
}

TEST_F(HeaderPose, Autel) {
  const ImageHeader old = header_of("xmlns:drone=\"http://www.autelrobotics.com/drone/1.0/\" " + kPix4dSpace +
                                        "Camera:Pitch=\"0.1\" Camera:Yaw=\"90\" Camera:Roll=\"0\"",
                                    "", gps_tags(1, 2, 3));
  EXPECT_LT((top(old) - kEastward).norm(), 0.01);
  const ImageHeader newer = header_of(kDjiSpace +
                                          "drone-dji:GpsLatitude=\"47.6\" drone-dji:GpsLongtitude=\"-122.1\" "
                                          "drone-dji:GimbalYawDegree=\"0\" drone-dji:GimbalPitchDegree=\"0\" "
                                          "drone-dji:GimbalRollDegree=\"0\"",
                                      "", {{"Exif.Image.Make", "Autel Robotics"}});
  EXPECT_EQ(newer.position->longitude_deg, -122.1);
  EXPECT_LT((view(newer) - kNorthward).norm(), 1e-12);
}

// A structure of three angles in the order north, east, down.
TEST_F(HeaderPose, Skydio) {
  const ImageHeader header = header_of(
      "xmlns:drone-skydio=\"https://www.skydio.com/drone-skydio/1.0/\" drone-skydio:Latitude=\"37.5\" "
      "drone-skydio:Longitude=\"-122.25\" drone-skydio:AbsoluteAltitude=\"41.5\"",
      "<drone-skydio:CameraOrientationNED rdf:parseType=\"Resource\"><drone-skydio:Yaw>90.0</drone-skydio:Yaw>"
      "<drone-skydio:Pitch>-30.0</drone-skydio:Pitch><drone-skydio:Roll>0.0</drone-skydio:Roll>"
      "</drone-skydio:CameraOrientationNED>");
  ASSERT_TRUE(header.position);
  EXPECT_EQ(header.position->longitude_deg, -122.25);
  EXPECT_EQ(header.position->height_m, 41.5);
  ASSERT_TRUE(header.attitude);
  EXPECT_LT((view(header) - Eigen::Vector3d(std::cos(30 * kDegree), 0, -std::sin(30 * kDegree))).norm(), 1e-12);
}

TEST_F(HeaderPose, CoordinatesOfTheXmpSpecification) {
  const ImageHeader header = header_of(
      "xmlns:exif=\"http://ns.adobe.com/exif/1.0/\" exif:GPSLatitude=\"46,50.5565S\" "
      "exif:GPSLongitude=\"91,59.6736E\" exif:GPSAltitude=\"19831/100\"",
      "");
  ASSERT_TRUE(header.position);
  EXPECT_NEAR(header.position->latitude_deg, -(46 + 50.5565 / 60), 1e-12);
  EXPECT_NEAR(header.position->longitude_deg, 91 + 59.6736 / 60, 1e-12);
  EXPECT_DOUBLE_EQ(header.position->height_m, 198.31);
}

TEST_F(HeaderPose, IncompleteAndSenselessTagsAreAbsence) {
  const ImageHeader header = header_of(kDjiSpace +
                                           "drone-dji:GpsLatitude=\"\" drone-dji:GpsLongitude=\"20\" "
                                           "drone-dji:GimbalYawDegree=\"x\" drone-dji:GimbalPitchDegree=\"0\" "
                                           "drone-dji:GimbalRollDegree=\"0\" drone-dji:RtkFlag=\"50\"",
                                       "");
  EXPECT_FALSE(header.position);
  EXPECT_FALSE(header.attitude);
}

}  // namespace
}  // namespace megablock
