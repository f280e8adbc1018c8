// The sections of the project file that change the block. Internal to io/ (project.cpp).
#pragma once

#include "io/project/image_scan.h"
#include "io/project/inputs/approximate_poses.h"
#include "io/project/inputs/control_file.h"
#include "io/text/yaml_reader.h"

namespace megablock {

// InputError for what would be passed over in silence: "block.yaml:4: 'masks' is not used with 'block', ...; take it
// out".
inline constexpr const char* kNoPictures = "with a 'block' without pictures";
[[noreturn]] void refuse_unused(const YamlReader& reader, const std::string& key, const std::string& why);

// cameras: grouping and overrides by camera name ("default" for all of them).
CameraGrouping read_camera_grouping(YamlReader& cameras);
void read_cameras(YamlReader& cameras, Block& block);
// model, focal length, principal point and distortion of one camera; its prior sigmas are left as they are.
void read_intrinsics(YamlReader& reader, Camera& camera);

// calibration: cameras and mounts as calibrated, in place of those that the block has.
void read_calibration(YamlReader& top, Project& project);

// masks: a folder with one PNG per camera, "<camera name>.png" ('/' in a name written as '_').
void read_masks(const std::string& folder, Project& project);

// rigs: joins the images of an exposure of a rig into one frame (OpenSfM's rig_cameras.json, rig_assignments.json).
void read_rigs(YamlReader& top, Project& project);

// poses: approximate poses.
std::optional<ApproximatePoses> read_poses(YamlReader& top);

// control: a file, or a mapping with the file and settings that override it.
std::optional<ControlTable> read_control(YamlReader& top);

// gps, origin: position priors in the ground frame; fixes the ground frame: `ground` (a running job's), else `origin`,
// else about the images' positions, else about the `others` (of poses and control).
void read_positions(YamlReader& top, const std::vector<ScannedImage>& scanned, const std::vector<Geodetic>& others,
                    const std::optional<GroundFrame>& ground, Project& project);

// attitude: attitude priors from the images' angles, turned to the block's vertical.
void read_attitudes(YamlReader& top, const std::vector<ScannedImage>& scanned, Project& project);

// A warning for the origin and for each control point more than 50 km (or a tenth of the block's extent) from the
// images.
void warn_of_distant_places(Project& project);

}  // namespace megablock
