// From a folder of images to cameras and frames: scanning, grouping, GNSS screening. Internal to io/ (project.cpp).
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/images/image_header.h"
#include "io/project/project.h"

namespace megablock {

struct ScannedImage {
  std::string name;  // relative path in the folder, '/' between parts
  std::string path;  // absolute
  ImageHeader header;
  std::uint64_t hash = 0;  // XXH3 of the file
};

// All jpg, jpeg, png, tif, tiff files below `folder` (letter case ignored), names sorted as bytes. Files that cannot be
// read go to project.unreadable, copies of an earlier file (same bytes) and unreadable sub-folders to project.warnings.
std::vector<ScannedImage> scan_images(const std::string& folder, Project& project);

enum class CameraGrouping { kExif, kFolder, kOne };

// Fills block.cameras, one rig per camera with the identity mount, a frame and an image per scanned image. Images of
// different size never share a camera. Priors of position and attitude are not set here.
void add_images(const std::vector<ScannedImage>& scanned, CameraGrouping grouping, Block& block);

// Verdict on the GNSS positions of the images: dropped when at 0,0, out of range, or more than 10 times the median
// distance and 1 km from the median of all (a warning names each image). Heights far off only are set to NaN.
std::vector<std::optional<Geodetic>> screen_positions(const std::vector<ScannedImage>& scanned,
                                                      std::vector<std::string>& warnings);

// Median position, rounded (0.001 degrees, 10 m) so that it is easy to write and seldom moves; NaN heights left out.
Geodetic rounded_median(const std::vector<Geodetic>& positions);

}  // namespace megablock
