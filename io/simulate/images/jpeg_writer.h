// Writes a rendered image as a camera would write it: as JPEG with EXIF.
// Internal to io/: it is not installed.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "io/block/crs.h"

namespace megablock {

struct SimulatedExif {
  std::string model;
  double focal_px = 0;  // written in millimetres, with the resolution of the focal plane
  double time_s = 0;    // seconds since 1970
  std::optional<Geodetic> position;
  double position_sigma_m = 0;  // horizontal; 0: not stated
};

// Writes a JPEG of quality 95. Throws InputError if the file cannot be written.
void write_jpeg(const std::string& path, const cv::Mat& image, const SimulatedExif& exif);

}  // namespace megablock
