// The project file (YAML, docs/reference/project-file.md): where the images are, what is known of them, the options of
// the job.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/text/stage_settings.h"

namespace megablock {

struct Project {
  std::string file;        // absolute path of the project file
  Block block;             // images, cameras, rigs, priors, control as read
  std::string tie_points;  // HDF5 of given tracks (write_tracks), absolute; empty: features and matching run
  StageSettings settings;
  std::vector<std::pair<std::string, std::string>> unreadable;  // image file and reason, reported and skipped
  std::vector<std::string> copies;    // image files left out because an earlier one has the same bytes
  std::vector<std::string> missing;   // images and exposures that the rigs' assignments name and that are not there
  std::vector<std::string> warnings;  // one line each: GPS at 0,0, duplicates, outliers ...
};

// Reads and validates; InputError with file:line for unknown keys, wrong types or units, missing files.
Project read_project(const std::string& path);
// The same in the ground frame of a running job, so that images added later cannot move the origin.
Project read_project(const std::string& path, const std::optional<GroundFrame>& ground);

// Of a camera's mask in the folder `masks`: "<camera>.png", '/' in the name written '_'.
std::string mask_file_name(const std::string& camera);

}  // namespace megablock
