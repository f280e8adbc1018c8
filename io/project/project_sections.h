// Reads those sections of the project file that change the block. Internal to io/ (project.cpp).
#pragma once

#include "io/project/image_scan.h"
#include "io/project/inputs/approximate_poses.h"
#include "io/project/inputs/control_file.h"
#include "io/project/trajectory/trajectories.h"
#include "io/text/yaml_reader.h"

namespace megablock {

// Throws InputError for a key that would otherwise be ignored without a word: "block.yaml:4: 'masks' is not used with
// 'block', ...; take it out".
inline constexpr const char* kNoImageFiles = "with a 'block' without image files";
[[noreturn]] void refuse_unused(const YamlReader& reader, const std::string& key, const std::string& why);

// cameras: the grouping, and values by camera name ("default" for all cameras).
CameraGrouping read_camera_grouping(YamlReader& cameras);
void read_cameras(YamlReader& cameras, Block& block);
// Reads model, focal length, principal point and distortion of one camera. Its prior sigmas do not change.
void read_intrinsics(YamlReader& reader, Camera& camera);

// calibration: replaces cameras and mounts of the block by calibrated ones.
void read_calibration(YamlReader& top, Project& project);

// masks: a folder with one PNG per camera, "<camera name>.png" ('/' in a name written as '_').
void read_masks(const std::string& folder, Project& project);

// rigs: joins the images of an exposure of a rig into one frame (OpenSfM's rig_cameras.json, rig_assignments.json).
void read_rigs(YamlReader& top, Project& project);

// poses: approximate poses.
std::optional<ApproximatePoses> read_poses(YamlReader& top);

// control: a file, or a mapping with the file and settings that override it.
std::optional<ControlTable> read_control(YamlReader& top);

// positions: files of positions of images, which take the place of those in the headers. Returns whether there are any.
bool read_position_files(YamlReader& top, std::vector<ScannedImage>& scanned, Project& project);

// trajectory: files of poses of frames. They count also with `gps: {use: false}` and `attitude: {use: false}`.
Trajectories read_trajectories(YamlReader& top, const std::vector<ScannedImage>& scanned,
                               const std::vector<std::string>& left_out, Project& project);

// gps, origin: sets the position priors and chooses the ground frame. This is `ground` (that of a running job), else
// that of `origin`, else one about the positions of the images, else one about the `others` (of trajectory, poses and
// control). `from_files`: the positions are those of files, which count also with `gps: {use: false}`. Returns the
// lever arm of `gps`.
Eigen::Vector3d read_positions(YamlReader& top, const std::vector<ScannedImage>& scanned, bool from_files,
                               const Trajectories& trajectories, const std::vector<Geodetic>& others,
                               const std::optional<GroundFrame>& ground, Project& project);

// attitude: sets the attitude priors from the angles of the images, turned to the vertical of the block's origin.
void read_attitudes(YamlReader& top, const std::vector<ScannedImage>& scanned, const Trajectories& trajectories,
                    Project& project);

// Warns if the origin or a control point is more than 50 km (and more than a tenth of the block's extent) away from the
// images. Throws InputError for control points that are also more than ten extents away: they would move the block.
// `control`: the table of the project file, whose points are the last ones of the block; nothing: all are the block's
// own.
void check_distant_places(const std::optional<ControlTable>& control, Project& project);
// Warns of cameras with a `readout_ms` of the project whose images have no times. Their motion is not known then.
void warn_of_unknown_motion(Project& project);

}  // namespace megablock
