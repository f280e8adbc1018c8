// What an image file says about itself: size, camera, time, GNSS position, attitude (EXIF and XMP, by Exiv2). The
// pixels are not decoded, and never rotated: `orientation` is only noted.
#pragma once

#include <limits>
#include <optional>
#include <string>

#include "io/block/crs.h"

namespace megablock {

struct ImageHeader {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  int width = 0, height = 0;          // pixels, as stored
  std::string make, model;            // trimmed; empty when absent
  double focal_mm = kUnknown;         // of the lens
  double sensor_width_mm = kUnknown;  // along the larger side, from the focal plane resolution
  double focal_35mm = kUnknown;       // 35 mm film equivalent
  int orientation = 1;                // EXIF code
  double time_s = kUnknown;           // DateTimeOriginal with sub-seconds, taken as UTC, seconds since 1970

  std::optional<Geodetic> position;               // height NaN when absent
  double position_sigma_horizontal_m = kUnknown;  // GPSHPositioningError, or RTK figures; DOP only widens the default
  double position_sigma_vertical_m = kUnknown;
  double dop = kUnknown;

  // Yaw, pitch, roll of the viewing direction (degrees) in the frame's own vertical, as a gimbal reports them.
  struct Attitude {
    double yaw_deg, pitch_deg, roll_deg;
  };
  std::optional<Attitude> attitude;
};

// jpg, jpeg, png, tif, tiff, letter case ignored: what is looked for in a folder of images.
bool is_image_name(const std::string& path);

// Reads the header; InputError with the reason (without the file's name) when the file is missing, empty, truncated in
// its header or not an image.
ImageHeader read_image_header(const std::string& path);

// Focal length in pixels along the larger side: focal plane resolution, else sensor table, else 35 mm equivalent (36 mm
// for the larger side). Empty when the header does not tell.
std::optional<double> focal_px(const ImageHeader& header);

}  // namespace megablock
