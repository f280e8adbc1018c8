// Reads a project file (YAML, docs/reference/project-file.md) and the files that it names into a block and the options
// of the stages.
//
// Where several sources tell the same thing, the strongest counts:
//
//     camera       `calibration`, then the section of the camera, then `cameras: default`, then the image headers,
//                  then the guess of 1.2 times the larger side
//     mounts       `calibration`, then the file of rig cameras
//     mask         the key `mask` of the camera, then the folder `masks`
//     position     `trajectory`, then `positions`, then the image headers; of a rig, that of its first image with one.
//                  Its sigmas: `gps`, then the section, the file or the header, then DOP or the default
//     attitude     `trajectory`, then `positions`, then the image headers
//     ground       that of the running job, then `origin`, then the median of the positions, of `trajectory`, of
//                  `poses`, of `control`
//     given pose   `poses` (the row of the frame, then that of its first image in the file), then `trajectory`
//     relative     `relative_poses` and `trajectory`, then a given block
//     control      the keys beside `control: file`, then the columns of the file, then the defaults
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
  Block block;             // images, cameras, rigs, priors, control, as read
  std::string tie_points;  // absolute path of the HDF5 file of given tracks (write_tracks); empty: tracks are matched
  StageSettings settings;
  std::vector<std::pair<std::string, std::string>> unreadable;  // image files that were skipped, with the reason
  std::vector<std::string> copies;    // image files that were left out because an earlier one has the same bytes
  std::vector<std::string> missing;   // images and exposures that the assignments of rigs name and that do not exist
  std::vector<std::string> found;     // where positions and attitudes of images come from, with sigmas; one line each
  std::vector<std::string> warnings;  // one line each: GPS at 0, 0, copies, outliers, ...
};

// Reads and checks a project. Throws InputError with file:line for unknown keys, wrong types or units, missing files.
// `sections`: the sections of options that the calling program reads. `ground`: the ground frame of a running job, so
// that images added later cannot move the origin.
Project read_project(const std::string& path, const std::vector<SettingsSection>& sections = {},
                     const std::optional<GroundFrame>& ground = std::nullopt);

// The file name of a camera's mask in the folder `masks`: "<camera>.png", with '_' for '/' in the camera's name.
std::string mask_file_name(const std::string& camera);

}  // namespace megablock
