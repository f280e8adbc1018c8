// Reads the section `calibration`: cameras and mounts from a file of `megablock calibrate`, of this block or of another
// block of the same rig.
#include <algorithm>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/block/calibration.h"
#include "io/project/project_sections.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

[[noreturn]] void unknown_name(const YamlReader& section, const std::string& name, const std::string& what,
                               const std::vector<std::string>& known) {
  throw InputError(section.where(name) + ": the block has no " + what + " '" + name + "'; it has " + listed(known) +
                   ". Remove the entry from the file, or correct its name");
}

void read_sigmas(YamlReader& camera, CameraCalibration& result) {
  auto sigma = camera.mapping("sigma");
  if (!sigma) return;
  constexpr Limits kSigma{1e-60, 1e12};  // coefficients of high order of a correction in pixels are this small
  const CameraModel& model = result.intrinsics.model();
  for (int p = 0; p < result.intrinsics.size(); ++p)
    if (const auto value = sigma->number(parameter_name(model, p), kSigma))
      result.sigma[static_cast<std::size_t>(p)] = *value;
  sigma->finish();
}

void read_calibrated_cameras(YamlReader& top, const Block& block, RigCalibration& calibration) {
  auto section = top.mapping("cameras");
  if (!section) return;
  std::vector<std::string> known;
  for (const Camera& camera : block.cameras) known.push_back(camera.name);
  for (const std::string& name : section->keys()) {
    const auto found = std::find(known.begin(), known.end(), name);
    if (found == known.end()) unknown_name(*section, name, "camera", known);
    Camera camera = block.cameras[CameraIndex(found - known.begin())];
    YamlReader reader = *section->mapping(name);
    read_intrinsics(reader, camera);
    CameraCalibration result{name, camera.intrinsics, camera.intrinsics};
    read_sigmas(reader, result);
    reader.finish();
    calibration.cameras.push_back(result);
  }
}

Eigen::Vector3d vector_of(YamlReader& reader, const std::string& key) {
  const auto values = reader.numbers(key, 3);
  if (!values) throw InputError(reader.where() + ": key '" + key + "' (three numbers) is missing");
  return {(*values)[0], (*values)[1], (*values)[2]};
}

MountCalibration read_mount(YamlReader& reader, const std::string& name) {
  MountCalibration mount;
  mount.name = name;
  const Eigen::Vector3d turn = vector_of(reader, "rotation"), translation = vector_of(reader, "translation");
  check_rotation_vector(turn, "rotation", reader.where("rotation"));
  check_on_vehicle(translation, "translation", reader.where("translation"));
  mount.pose.rotation = rotation_exp<double>(turn).normalized();
  // The file has X_camera = R X_rig + t, as OpenSfM does, so the centre is -R' t.
  mount.pose.centre = -(mount.pose.rotation.conjugate() * translation);
  const double rotation = kDegree * reader.number("sigma_rotation_deg", {0, kSigmaDegrees.most}).value_or(0);
  const double position = reader.number("sigma_position_m", {0, kSigmaMetres.most}).value_or(0);
  // Rotation first, then position, as in PoseIncrement.
  mount.covariance.diagonal() << Eigen::Vector3d::Constant(rotation * rotation),
      Eigen::Vector3d::Constant(position * position);
  reader.finish();
  return mount;
}

void read_calibrated_mounts(YamlReader& top, const Block& block, RigCalibration& calibration,
                            std::vector<std::string>& warnings) {
  auto section = top.mapping("mounts");
  if (!section) return;
  std::vector<std::string> known;
  for (RigIndex rig(0); block.rigs.contains(rig); ++rig.value)
    for (std::size_t m = 0; m < block.rigs[rig].cameras().size(); ++m)
      known.push_back(mount_name(block, rig, static_cast<std::int32_t>(m)));
  const std::vector<std::string> given = section->keys();
  for (const std::string& name : given) {
    if (std::find(known.begin(), known.end(), name) == known.end()) unknown_name(*section, name, "rig camera", known);
    YamlReader reader = *section->mapping(name);
    calibration.mounts.push_back(read_mount(reader, name));
  }
  for (const std::string& name : known)
    if (std::find(given.begin(), given.end(), name) == given.end() && !given.empty())
      warnings.push_back("rig camera '" + name + "' is not in '" + section->file() + "' and keeps its previous mount");
}

}  // namespace

void read_calibration(YamlReader& top, Project& project) {
  const auto node = top.node("calibration");
  if (!node) return;
  std::optional<std::string> path;
  bool hold = true;
  if (node->IsMap()) {
    YamlReader section = *top.mapping("calibration");
    path = section.existing_file("file");
    if (!path) throw InputError(section.where() + ": key 'file' is missing in 'calibration'");
    hold = section.flag("hold").value_or(true);
    section.finish();
  } else {
    path = top.existing_file("calibration");
  }
  YamlReader file = read_yaml(*path);
  RigCalibration calibration;
  read_calibrated_cameras(file, project.block, calibration);
  read_calibrated_mounts(file, project.block, calibration, project.warnings);
  file.finish();
  apply_calibration(calibration, hold, project.block);
}

}  // namespace megablock
