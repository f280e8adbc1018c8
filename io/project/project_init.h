// Writes a project file for a folder of images (`megablock init`).
#pragma once

#include <string>

namespace megablock {

struct InitOptions {
  std::string images;  // folder, searched recursively, names sorted
  std::string output = "block.yaml";
  std::string gcp_file, mask_folder;     // optional
  std::string camera_grouping = "exif";  // "exif" (make, model, size, focal), "folder", "one"
};
// Scans the images and writes the project file. Returns its one-paragraph summary.
std::string init_project(const InitOptions& options);

}  // namespace megablock
