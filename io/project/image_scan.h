// Finds the images of a folder, groups them into cameras and frames, and rejects implausible GNSS positions. Internal
// to io/ (project.cpp).
#pragma once

#include <filesystem>
#include <optional>
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
  // From a file of positions in the block's own frame, which needs no place on earth; header.position is then empty.
  std::optional<Eigen::Vector3d> local_position;     // metres
  std::optional<Eigen::Quaterniond> local_attitude;  // ground frame -> camera
};

// Whether a file or folder is one that systems leave among images, with the endings of images: copies of the metadata
// that macOS writes on foreign disks ("._a.jpg"), hidden ones, thumbnails of a network disk, archives, waste bins.
bool is_leftover(const std::filesystem::path& path);

// Returns all jpg, jpeg, png, tif and tiff files below `folder` (in upper or lower case), sorted by the bytes of their
// names, without leftovers. Files that cannot be read go to project.unreadable. Copies of an earlier file (same bytes)
// go to project.copies and, like unreadable sub-folders, to project.warnings.
std::vector<ScannedImage> scan_images(const std::string& folder, Project& project);

// The images that share a camera: kExif by the name "<make> <model> <width>x<height> <focal>mm" (the make is not
// repeated where the model begins with it), kFolder by folder and size, kOne by size.
enum class CameraGrouping { kExif, kFolder, kOne };

// Adds cameras, one rig per camera with the identity as its mount, and a frame and an image for each scanned image.
// Images of different sizes never share a camera. Priors of position and attitude are not set here.
void add_images(const std::vector<ScannedImage>& scanned, CameraGrouping grouping, Block& block);

// Returns the plausible GNSS positions of the images. A position is dropped if it is 0, 0 or out of range, or if its
// distance from the median of all is above 1 km and above 10 times the median distance; a warning names each such
// image. If only the height is far off, it is set to NaN.
std::vector<std::optional<Geodetic>> screen_positions(const std::vector<ScannedImage>& scanned,
                                                      std::vector<std::string>& warnings);

// The median position, rounded to 0.001 degrees and 10 m: it is then short to write and seldom changes with more
// images. Heights that are NaN do not count.
Geodetic rounded_median(const std::vector<Geodetic>& positions);

}  // namespace megablock
