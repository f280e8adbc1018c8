// Reads the header of an image file (EXIF and XMP, by Exiv2): size, camera, time, GNSS position, attitude. The pixels
// are neither decoded nor rotated; `orientation` is only reported.
//
// Units and references of the sources:
//
//     focal length   f_px = f_mm / width_mm * larger side: the width of the sensor counts along its larger side. With a
//                    resolution of r pixels per unit it is pixels / r * (25.4 for inches, 10 for cm, 1 for mm).
//     pose           io/images/header_pose.h
//     time           DateTimeOriginal has no time zone; it is taken as UTC.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "io/block/crs.h"

namespace megablock {

struct ImageHeader {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  int width = 0, height = 0;          // pixels, as stored
  std::string make, model;            // trimmed; empty if absent
  double focal_mm = kUnknown;         // of the lens
  double sensor_width_mm = kUnknown;  // along the larger side, from the focal plane resolution
  double focal_35mm = kUnknown;       // equivalent for 35 mm film
  int orientation = 1;                // EXIF code
  double time_s = kUnknown;           // DateTimeOriginal with fractions, taken as UTC, seconds since 1970

  // Of the GNSS time stamp, UTC, seconds since 1970; and DateTimeOriginal minus UTC, where the header says its zone.
  double gps_time_s = kUnknown, zone_s = kUnknown;

  std::optional<Geodetic> position;  // height NaN if absent
  std::string position_source;       // for the user: "EXIF", "XMP (drone-dji)"
  // Standard deviations that the header states; a DOP only widens the default.
  double position_sigma_horizontal_m = kUnknown;
  double position_sigma_vertical_m = kUnknown;
  double dop = kUnknown;
  // The kind of solution of an RTK receiver.
  enum class Fix : std::uint8_t { kUnstated, kSingle, kFloat, kFixed } fix = Fix::kUnstated;

  struct Attitude {
    Eigen::Quaterniond rotation;  // from the axes east, north, up at the image to those of the camera
    std::string source;           // for the user: "XMP (drone-dji)"
  };
  std::optional<Attitude> attitude;
  double compass_deg = kUnknown;  // GPSImgDirection; it says nothing of pitch and roll
};

// Whether the name ends in jpg, jpeg, png, tif or tiff, in upper or lower case. Folders are searched for such files.
bool is_image_name(const std::string& path);

// Reads the header. Throws InputError with the reason (without the file's name) for a file that is missing, empty,
// truncated in its header, or no image.
ImageHeader read_image_header(const std::string& path);

// Focal length in pixels of the larger side: from the resolution in the focal plane, else from the sensor table, else
// from the equivalent for 35 mm film (36 mm are the larger side). Empty if the header has none of these.
std::optional<double> focal_px(const ImageHeader& header);

}  // namespace megablock
