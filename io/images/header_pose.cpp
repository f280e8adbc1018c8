#include "io/images/header_pose.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "geometry/numbers/angles.h"
#include "geometry/transform/body_attitude.h"
#include "geometry/transform/rotation.h"
#include "io/text/text_lines.h"

namespace megablock {

namespace {

// Names of positions in XMP. To read another maker, add a row.
struct PositionTags {
  const char *prefix, *latitude, *longitude, *height;
};
constexpr PositionTags kPositions[] = {{"drone-dji", "GpsLatitude", "GpsLongitude", "AbsoluteAltitude"},
                                       {"drone-dji", "GpsLatitude", "GpsLongtitude", "AbsoluteAltitude"},  // sic
                                       {"drone-dji", "Latitude", "Longitude", "AbsoluteAltitude"},
                                       {"drone", "GpsLatitude", "GpsLongitude", "AbsoluteAltitude"},
                                       {"drone-skydio", "Latitude", "Longitude", "AbsoluteAltitude"},
                                       {"exif", "GPSLatitude", "GPSLongitude", "GPSAltitude"}};

// Names of attitudes in XMP, and the kind of their angles.
enum class HeaderAngles : std::uint8_t { kGimbal, kPix4d };
struct AttitudeTags {
  const char *prefix, *yaw, *pitch, *roll;
  HeaderAngles angles;
};
constexpr AttitudeTags kAttitudes[] = {
    {"drone-dji", "GimbalYawDegree", "GimbalPitchDegree", "GimbalRollDegree", HeaderAngles::kGimbal},
    {"drone-parrot", "CameraYawDegree", "CameraPitchDegree", "CameraRollDegree", HeaderAngles::kGimbal},
    {"drone-skydio", "CameraOrientationNED/drone-skydio:Yaw", "CameraOrientationNED/drone-skydio:Pitch",
     "CameraOrientationNED/drone-skydio:Roll", HeaderAngles::kGimbal},
    {"drone", "GimbalYawDegree", "GimbalPitchDegree", "GimbalRollDegree", HeaderAngles::kGimbal},
    {"Camera", "Yaw", "Pitch", "Roll", HeaderAngles::kPix4d}};

constexpr double kGimbalDoubtDeg = 20;

// Sigmas of a solution whose own the header does not state, metres.
struct FixSigmas {
  double horizontal, vertical;
};
constexpr FixSigmas kFixedSigmas{0.03, 0.06}, kFloatSigmas{0.5, 1};

// Degrees from the three rationals degrees, minutes and seconds; the last two may be absent.
double dms_degrees(const ExifFields& exif, const char* key) {
  const double degrees = exif.number(key, 0), minutes = exif.number(key, 1), seconds = exif.number(key, 2);
  return degrees + (std::isnan(minutes) ? 0 : minutes / 60) + (std::isnan(seconds) ? 0 : seconds / 3600);
}

// A latitude or longitude in XMP: decimal degrees, or degrees and minutes with a letter ("46,50.55650N") as the XMP
// specification writes GPSCoordinate.
double xmp_degrees(const XmpFields& xmp, const char* prefix, const char* name) {
  const std::string text = trimmed(xmp.text(prefix, name));
  const double degrees = xmp.number(prefix, name);
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) return degrees;
  double minutes = 0;
  std::from_chars(text.data() + comma + 1, text.data() + text.size(), minutes);
  const double value = degrees + minutes / 60;
  return text.back() == 'S' || text.back() == 'W' ? -value : value;
}

std::string xmp_source(const char* prefix) { return std::string("XMP (") + prefix + ")"; }

void read_exif_position(const ExifFields& exif, const XmpFields& xmp, ImageHeader& header) {
  double latitude = dms_degrees(exif, "Exif.GPSInfo.GPSLatitude");
  double longitude = dms_degrees(exif, "Exif.GPSInfo.GPSLongitude");
  if (std::isnan(latitude) || std::isnan(longitude)) return;
  if (exif.text("Exif.GPSInfo.GPSLatitudeRef") == "S") latitude = -latitude;
  if (exif.text("Exif.GPSInfo.GPSLongitudeRef") == "W") longitude = -longitude;
  double height = exif.number("Exif.GPSInfo.GPSAltitude");
  if (exif.number("Exif.GPSInfo.GPSAltitudeRef") == 1) height = -height;
  if (std::isnan(height)) height = xmp.number("drone-dji", "AbsoluteAltitude");
  header.position = Geodetic{latitude, longitude, height};
  header.position_source = "EXIF";
}

void read_xmp_position(const XmpFields& xmp, ImageHeader& header) {
  for (const PositionTags& tags : kPositions) {
    const double latitude = xmp_degrees(xmp, tags.prefix, tags.latitude);
    const double longitude = xmp_degrees(xmp, tags.prefix, tags.longitude);
    if (std::isnan(latitude) || std::isnan(longitude)) continue;
    header.position = Geodetic{latitude, longitude, xmp.number(tags.prefix, tags.height)};
    header.position_source = xmp_source(tags.prefix);
    return;
  }
}

ImageHeader::Fix fix_of(double flag) {
  if (flag >= 50) return ImageHeader::Fix::kFixed;
  if (flag >= 32) return ImageHeader::Fix::kFloat;
  return flag >= 16 ? ImageHeader::Fix::kSingle : ImageHeader::Fix::kUnstated;
}

// RTK values are the standard deviations of this image and replace general estimates.
void read_sigmas(const ExifFields& exif, const XmpFields& xmp, ImageHeader& header) {
  header.dop = exif.number("Exif.GPSInfo.GPSDOP");
  double horizontal = exif.number("Exif.GPSInfo.0x001f"), vertical = ImageHeader::kUnknown;  // GPSHPositioningError
  const auto replace = [](double by, double& sigma) {
    if (by > 0) sigma = by;
  };
  header.fix = fix_of(xmp.number("drone-dji", "RtkFlag"));
  if (header.fix == ImageHeader::Fix::kFixed || header.fix == ImageHeader::Fix::kFloat) {
    const FixSigmas& sigmas = header.fix == ImageHeader::Fix::kFixed ? kFixedSigmas : kFloatSigmas;
    if (!(horizontal > 0)) horizontal = sigmas.horizontal;
    vertical = sigmas.vertical;
  }
  replace(xmp.number("Camera", "GPSXYAccuracy"), horizontal);
  replace(xmp.number("Camera", "GPSZAccuracy"), vertical);
  const double east = xmp.number("drone-dji", "RtkStdLon"), north = xmp.number("drone-dji", "RtkStdLat");
  if (east > 0 && north > 0) horizontal = std::max(east, north);
  replace(xmp.number("drone-dji", "RtkStdHgt"), vertical);
  header.position_sigma_horizontal_m = horizontal;
  header.position_sigma_vertical_m = vertical;
}

// The angles of a gimbal are those of the camera. HeaderAngles of the flight are those of the body and say nothing
// about a camera on a gimbal. For a fixed camera they would need the assumption that it looks along the body's z axis,
// so they are not used alone.
void read_attitude(const XmpFields& xmp, ImageHeader& header) {
  for (const AttitudeTags& tags : kAttitudes) {
    const double yaw = xmp.number(tags.prefix, tags.yaw) * kDegree;
    const double pitch = xmp.number(tags.prefix, tags.pitch) * kDegree;
    double roll = xmp.number(tags.prefix, tags.roll) * kDegree;
    if (std::isnan(yaw) || std::isnan(pitch) || std::isnan(roll)) continue;
    const bool gimbal =
        tags.angles == HeaderAngles::kGimbal || std::abs(pitch + 90 * kDegree) < kGimbalDoubtDeg * kDegree;
    if (!gimbal && lower_case(header.make) == "sensefly") roll = -roll;
    header.attitude = {
        gimbal ? rotation_from(YawPitchRoll{yaw, pitch, roll}) : rotation_from(BodyAttitude{yaw, pitch, roll}),
        xmp_source(tags.prefix)};
    return;
  }
}

}  // namespace

void read_header_pose(const ExifFields& exif, const XmpFields& xmp, ImageHeader& header) {
  read_exif_position(exif, xmp, header);
  if (!header.position) read_xmp_position(xmp, header);
  if (header.position) read_sigmas(exif, xmp, header);
  read_attitude(xmp, header);
  header.compass_deg = exif.number("Exif.GPSInfo.GPSImgDirection");
}

}  // namespace megablock
