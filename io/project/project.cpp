// Reads the project file section by section. Values from the image headers are set first; those of the project file
// override them.
#include "io/project/project.h"

#include <fmt/core.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>

#include "io/base/error.h"
#include "io/project/image_scan.h"
#include "io/project/inputs/approximate_poses.h"
#include "io/project/inputs/control_file.h"
#include "io/project/inputs/frame_measurements_file.h"
#include "io/project/inputs/lines.h"
#include "io/project/inputs/relative_poses_file.h"
#include "io/project/inputs/verticals.h"
#include "io/project/project_sections.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/units/block_file.h"
#include "io/text/settings_reader.h"
#include "io/text/yaml_reader.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

// A value as text: "true", "[0, 0.1, -0.2]". It is not checked here, but where the block is read.
std::string text_of(const YAML::Node& node) {
  if (!node.IsSequence()) return node.IsScalar() ? node.Scalar() : "";
  std::string list;
  for (const YAML::Node& value : node) list += (list.empty() ? "" : ", ") + text_of(value);
  return "[" + list + "]";
}

// Returns the options of the stages. Those of the sections gps and attitude are added for the report only.
StageSettings read_stage_settings(YamlReader& top, const std::vector<SettingsSection>& sections) {
  StageSettings settings;
  for (const char* section : {"gps", "attitude"})
    if (auto reader = top.mapping(section))
      for (const std::string& key : reader->keys())
        settings.entries.push_back({section, key, text_of(*reader->node(key)), reader->where(key)});
  for (const SettingsSection& section : sections) {
    auto reader = top.mapping(section.name);
    if (!reader) continue;
    for (const std::string& key : reader->keys()) {
      const auto value = key == section.file_key ? reader->existing_file(key) : reader->text(key);
      settings.entries.push_back({section.name, key, *value, reader->where(key)});
    }
  }
  return settings;
}

// Turns the error of a store file into that of a file that the user named. To delete it and run again, as the store
// advises, does not help here, because the job does not make this file.
InputError refusal(YamlReader& top, const std::string& key, const StoreError& error) {
  std::string reason = error.what();
  if (const auto remedy = reason.find("; delete it"); remedy != std::string::npos)
    reason.replace(remedy, std::string::npos, "; make it again");
  return InputError(top.where(key) + ": " + key + ": " + reason);
}

void read_simulated_block(YamlReader& top, Project& project, const std::string& block_file) {
  try {
    project.block = read_block(block_file);
  } catch (const StoreError& error) {
    throw refusal(top, "block", error);
  }
}

// Throws InputError if the file holds no tracks. The tracks themselves are read later, when a stage needs them.
void check_tie_points(YamlReader& top, const std::string& file) {
  try {
    Hdf5Reader(file, "tracks");
  } catch (const StoreError& error) {
    throw refusal(top, "tie_points", error);
  }
}

// Throws InputError for sections of stages that do not run with given tie points.
void refuse_unused_stages(const YamlReader& top, const std::vector<SettingsSection>& sections) {
  for (const std::string& key : top.keys())
    if (std::ranges::any_of(sections, [&](const SettingsSection& s) { return s.needs_images && s.name == key; }))
      refuse_unused(top, key, "with 'tie_points', which are measured and matched already");
}

// The images that are not in the block for a reason that was reported. Files that refer to them are therefore accepted.
std::vector<std::string> names_left_out(const Project& project) {
  std::vector<std::string> names = project.copies;
  names.insert(names.end(), project.missing.begin(), project.missing.end());
  for (const auto& [name, reason] : project.unreadable) names.push_back(name);
  return names;
}

// Local control has an origin of its own, which its file does not name.
void warn_of_local_control(const YamlReader& top, const ControlTable& control, Project& project) {
  const GroundFrame& ground = project.block.ground;
  const std::vector<std::string> keys = top.keys();
  if (control.crs != "local" || !ground.georeferenced || std::ranges::find(keys, "origin") != keys.end()) return;
  project.warnings.push_back(
      fmt::format("the coordinates of the control are local, and the project names no origin: they are taken about "
                  "latitude {:.7g}, longitude {:.7g}, height {:.0f} m, a place among the positions; write their own "
                  "origin into 'origin: [latitude, longitude, height]'",
                  ground.latitude_deg, ground.longitude_deg, ground.height_m));
}

// Reads the keys that name files or change the block, in the order in which they depend on each other: images make
// cameras and frames; rigs join frames; a calibration needs cameras and mounts. Poses and control are read before the
// positions, because they may give the origin, but are added after them: only then is the ground frame known. Attitudes
// need the positions, for the vertical at each of them.
// Returns the table of `control`.
std::optional<ControlTable> read_block_sections(YamlReader& top, Project& project,
                                                const std::vector<SettingsSection>& sections,
                                                const std::optional<GroundFrame>& ground) {
  const auto images = top.existing_folder("images");
  const auto block_file = top.existing_file("block");
  if (images && block_file)
    throw InputError(top.where("block") + ": 'images' and 'block' exclude each other; give one of them");
  for (const std::string& key : top.keys())
    if (!images && !block_file && !nearest_name(key, {"images"}).empty())
      throw InputError(top.where(key) + ": unknown key '" + key + "'; did you mean 'images'?");
  if (!images && !block_file)
    throw InputError(top.where() + ": key 'images' (a folder of images) is missing; add for example 'images: images'");
  if (const auto tie_points = top.existing_file("tie_points")) {
    check_tie_points(top, *tie_points);
    project.tie_points = *tie_points;
    refuse_unused_stages(top, sections);
  }
  if (block_file && project.tie_points.empty())
    throw InputError(top.where("block") + ": 'block' needs 'tie_points' as well: there are no images to measure in");

  std::vector<ScannedImage> scanned;
  if (images) scanned = scan_images(*images, project);
  if (images && scanned.empty())
    throw InputError(top.where("images") + ": images: no readable image (jpg, png, tif) below '" + *images + "'" +
                     (project.unreadable.empty()
                          ? ""
                          : "; first reason: " + project.unreadable[0].first + ": " + project.unreadable[0].second));
  if (block_file) read_simulated_block(top, project, *block_file);

  auto cameras = top.mapping("cameras");
  if (cameras && block_file && cameras->node("grouping"))
    refuse_unused(*cameras, "grouping", "with 'block', whose file defines the cameras");
  const CameraGrouping grouping = cameras ? read_camera_grouping(*cameras) : CameraGrouping::kExif;
  if (images) {
    project.block.image_folder = (fs::path(*images) / "").string();
    add_images(scanned, grouping, project.block);
  }
  if (cameras) read_cameras(*cameras, project.block);
  if (const auto masks = top.existing_folder("masks")) {
    if (!has_image_files(project.block)) refuse_unused(top, "masks", kNoImageFiles);
    read_masks(*masks, project);
  }
  read_rigs(top, project);
  read_calibration(top, project);

  const auto poses = read_poses(top);
  auto control = read_control(top);
  const Trajectories trajectories = read_trajectories(top, scanned, names_left_out(project), project);
  std::vector<Geodetic> others = trajectories.places();
  if (poses && others.empty()) others = poses->positions();
  if (control && others.empty()) others = geodetic_positions(*control);
  const bool from_files = read_position_files(top, scanned, project);
  const Eigen::Vector3d lever_arm = read_positions(top, scanned, from_files, trajectories, others, ground, project);
  read_attitudes(top, scanned, trajectories, project);
  trajectories.set_starts(lever_arm, project.block);
  if (poses) set_given_poses(*poses, names_left_out(project), project.block, project.warnings);
  if (control) {
    add_control(*control, names_left_out(project), project.block, project.warnings);
    if (images) warn_of_local_control(top, *control, project);
  }
  if (const auto lines = top.existing_file("lines"))
    read_lines(*lines, names_left_out(project), project.block, project.warnings);
  if (const auto relative = top.existing_file("relative_poses")) {
    if (std::ranges::any_of(trajectories.sources, [](const auto& source) { return source.relative.has_value(); }))
      throw InputError(top.where("relative_poses") +
                       ": 'relative_poses' and 'relative' of 'trajectory' state the same thing; take one of them out");
    read_relative_poses(*relative, names_left_out(project), project.block, project.warnings);
  }
  for (const FrameMeasurementType& type : frame_measurement_types())
    if (const auto file = top.existing_file(type.key))
      read_frame_measurements(type, *file, names_left_out(project), project.block, project.warnings);
  if (const auto verticals = top.existing_file("verticals"))
    read_verticals(*verticals, names_left_out(project), project.block);
  return control;
}

}  // namespace

void refuse_unused(const YamlReader& reader, const std::string& key, const std::string& why) {
  throw InputError(reader.where(key) + ": '" + key + "' is not used " + why + "; take it out");
}

Project read_project(const std::string& path, const std::vector<SettingsSection>& sections,
                     const std::optional<GroundFrame>& ground) {
  Project project;
  project.file = fs::absolute(path).lexically_normal().string();
  YamlReader top = read_yaml(path);
  project.settings = read_stage_settings(top, sections);
  const std::optional<ControlTable> control = read_block_sections(top, project, sections, ground);
  top.finish();
  try {
    check(project.block);
  } catch (const InputError& error) {
    throw InputError(project.file + ": " + error.what());
  }
  check_distant_places(control, project);
  warn_of_unknown_motion(project);
  return project;
}

}  // namespace megablock
