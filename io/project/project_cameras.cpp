// Reads the section `cameras` of the project file (grouping, models, parameters, what to calibrate) and the masks.
#include <algorithm>
#include <filesystem>

#include "io/base/error.h"
#include "io/project/inputs/camera_priors.h"
#include "io/project/project_sections.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

// The parameters that a name in `calibrate: [...]` stands for: one parameter, or one of three groups.
std::vector<int> parameters_named(const Camera& camera, const std::string& name, const std::string& where) {
  const CameraModel& model = camera.intrinsics.model();
  if (name == "focal") return {kFocal};
  if (name == "principal_point") return {kPrincipalX, kPrincipalY};
  if (const auto parameter = find_parameter(model, name)) return {*parameter};
  if (name == "usual" || name == "auto") {
    std::vector<int> usual;
    for (int p = 0; p < parameter_count(model); ++p)
      if (contains(usual_parameters(model), p)) usual.push_back(p);
    return usual;
  }
  std::string list = "auto, usual, focal, principal_point";
  for (int p = 0; p < parameter_count(model); ++p) list += ", " + parameter_name(model, p);
  throw InputError(where + ": calibrate: '" + name + "' is not a parameter of camera '" + camera.name + "' (model " +
                   model_name(model) + "); its parameters are " + list);
}

void hold_except(const YAML::Node& list, const std::string& where, Camera& camera) {
  const CameraModel& model = camera.intrinsics.model();
  ParameterMask asked = 0;
  for (const auto& item : list)
    for (const int p : parameters_named(camera, item.IsScalar() ? item.Scalar() : "", where)) {
      if (is_fixed(model, p))
        throw InputError(where + ": calibrate: '" + parameter_name(model, p) + "' of the model " + model_name(model) +
                         " follows from the size of the image and cannot be estimated; take it out of 'calibrate'");
      asked |= mask_of(p);
    }
  camera.prior_sigma = default_intrinsic_sigmas(camera, asked);
}

// Sets the camera model. The focal length and the principal point of the camera remain.
void read_model(YamlReader& reader, Camera& camera) {
  const auto name = reader.text("model");
  if (!name) return;
  const auto model = find_model(*name);
  if (!model)
    throw InputError(reader.where("model") + ": model: '" + *name + "' is not a camera model; the models are " +
                     model_list());
  if (*model == camera.intrinsics.model()) return;
  const Intrinsics before = camera.intrinsics;
  camera.intrinsics = start_intrinsics(*model, before[kFocal], camera.width, camera.height);
  camera.intrinsics[kPrincipalX] = before[kPrincipalX];
  camera.intrinsics[kPrincipalY] = before[kPrincipalY];
}

void read_focal(YamlReader& reader, Camera& camera) {
  constexpr Limits kLengthMm{1e-3, 1e6};
  const auto pixels = reader.number("focal_px", kFocalPx);
  const auto millimetres = reader.number("focal_mm", kLengthMm), sensor = reader.number("sensor_mm", kLengthMm);
  if (pixels && millimetres)
    throw InputError(reader.where("focal_mm") + ": give focal_px, or focal_mm with sensor_mm, not both");
  if (millimetres.has_value() != sensor.has_value())
    throw InputError(reader.where() +
                     ": focal_mm needs sensor_mm (length of the larger side of the sensor), and sensor_mm needs "
                     "focal_mm; give both");
  if (!pixels && !millimetres) return;
  if (is_fixed(camera.intrinsics.model(), kFocal))
    throw InputError(reader.where(pixels ? "focal_px" : "focal_mm") +
                     ": the focal length of an equirectangular camera is its width / 2 pi; remove this key");
  // sensor_mm is the length of the larger side, so the larger side in pixels belongs to it.
  camera.intrinsics[kFocal] = pixels ? *pixels : *millimetres / *sensor * std::max(camera.width, camera.height);
  if (millimetres) check_within(camera.intrinsics[kFocal], kFocalPx, "focal_mm in pixels", reader.where("focal_mm"));
  camera.focal_known = true;
}

void read_distortion(YamlReader& reader, Camera& camera) {
  auto distortion = reader.mapping("distortion");
  if (!distortion) return;
  constexpr Limits kTerm{-1e12, 1e12};
  const CameraModel& model = camera.intrinsics.model();
  for (int p = kPrincipalY + 1; p < camera.intrinsics.size(); ++p)
    if (is_fixed(model, p))
      continue;
    else if (const auto value = distortion->number(parameter_name(model, p), kTerm))
      camera.intrinsics[static_cast<std::size_t>(p)] = *value;
  distortion->finish();
}

}  // namespace

void read_intrinsics(YamlReader& reader, Camera& camera) {
  read_model(reader, camera);
  read_focal(reader, camera);
  if (const auto point = reader.numbers("principal_point_px", 2)) {
    for (const double coordinate : *point)
      check_within(coordinate, {-kFocalPx.most, kFocalPx.most}, "principal_point_px",
                   reader.where("principal_point_px"));
    set_principal_point((*point)[0], (*point)[1], camera.intrinsics);
  }
  read_distortion(reader, camera);
}

namespace {

// `auto` is what the table of cameras says (`table_s`; 0: nothing), if the images confirm it.
void read_readout(YamlReader& reader, double table_s, Camera& camera) {
  const auto text = reader.text("readout_ms");
  if (!text) return;
  if (*text == "auto") {
    camera.readout_s = table_s;
    camera.estimate_readout = table_s != 0;
    return;
  }
  camera.estimate_readout = *text == "estimate";
  camera.readout_s = 0;
  if (camera.estimate_readout) return;
  const double ms =
      parse_number(*text, "readout_ms, which is 'auto', 'estimate' or a number,", reader.where("readout_ms"));
  check_within(ms, {-1000 * kLongestReadoutS, 1000 * kLongestReadoutS}, "readout_ms", reader.where("readout_ms"));
  camera.readout_s = ms / 1000;
}

void read_values(YamlReader& reader, bool image_files, double table_readout_s, Camera& camera) {
  read_intrinsics(reader, camera);
  read_readout(reader, table_readout_s, camera);
  if (const auto mask = reader.existing_file("mask")) {
    if (!image_files) refuse_unused(reader, "mask", kNoImageFiles);
    camera.mask_path = *mask;
  }
}

bool is_auto(const YAML::Node& node) { return node.IsScalar() && node.Scalar() == "auto"; }

// Holds the parameters that `calibrate` does not free. `auto`, alone or in a list, leaves the choice among them to the
// block.
void read_calibrate(YamlReader& reader, Camera& camera) {
  const auto calibrate = reader.node("calibrate");
  camera.choose =
      is_auto(*calibrate) || (calibrate->IsSequence() && std::any_of(calibrate->begin(), calibrate->end(), is_auto));
  if (calibrate->IsSequence())
    hold_except(*calibrate, reader.where("calibrate"), camera);
  else if (!camera.choose && !*reader.flag("calibrate"))
    camera.prior_sigma.fill(0);
}

// What the section of the camera says overrides the section of all cameras.
void read_camera(YamlReader& cameras, bool image_files, Camera& camera) {
  auto common = cameras.mapping("default"), own = cameras.mapping(camera.name);
  if (!common && !own) return;
  const auto has_calibrate = [](auto& section) { return section && section->node("calibrate"); };
  const bool for_all = has_calibrate(common), for_this = has_calibrate(own);  // asks both, so that both know the key
  const auto only_readout = [](auto& section) {
    return !section || section->keys() == std::vector<std::string>{"readout_ms"};
  };
  const bool keeps_sigmas = only_readout(common) && only_readout(own);
  const double table_readout_s = camera.estimate_readout ? camera.readout_s : 0;
  if (common) read_values(*common, image_files, table_readout_s, camera);
  if (own) read_values(*own, image_files, table_readout_s, camera);
  // After the values, because the sigmas depend on the focal length and on whether it is known. A readout time says
  // nothing of them.
  if (!keeps_sigmas) camera.prior_sigma = default_intrinsic_sigmas(camera);
  if (for_this)
    read_calibrate(*own, camera);
  else if (for_all)
    read_calibrate(*common, camera);
  if (common) common->finish();
  if (own) own->finish();
}

std::string names_of(const Block& block) {
  std::string list;
  for (const Camera& camera : block.cameras) list += (list.empty() ? "'" : ", '") + camera.name + "'";
  return list;
}

void check_mask(const Camera& camera, const std::string& where) {
  ImageHeader header;
  try {
    header = read_image_header(camera.mask_path);
  } catch (const InputError& error) {
    throw InputError(where + ": mask '" + camera.mask_path + "': " + error.what());
  }
  if (header.width == camera.width && header.height == camera.height) return;
  throw InputError(where + ": mask '" + camera.mask_path + "' has " + std::to_string(header.width) + " x " +
                   std::to_string(header.height) + " pixels, camera '" + camera.name + "' has " +
                   std::to_string(camera.width) + " x " + std::to_string(camera.height) +
                   "; a mask must have the size of the images");
}

}  // namespace

CameraGrouping read_camera_grouping(YamlReader& cameras) {
  const std::string grouping = cameras.text("grouping").value_or("exif");
  if (grouping == "exif") return CameraGrouping::kExif;
  if (grouping == "folder") return CameraGrouping::kFolder;
  if (grouping == "one") return CameraGrouping::kOne;
  throw InputError(cameras.where("grouping") + ": cameras.grouping: '" + grouping +
                   "' is not one of: exif, folder, one");
}

void read_cameras(YamlReader& cameras, Block& block) {
  const bool image_files = has_image_files(block);
  for (Camera& camera : block.cameras) {
    read_camera(cameras, image_files, camera);
    if (!camera.mask_path.empty()) check_mask(camera, cameras.where());
  }
  for (const std::string& key : cameras.keys())
    if (key != "grouping" && key != "default" &&
        std::none_of(block.cameras.begin(), block.cameras.end(), [&](const Camera& c) { return c.name == key; }))
      throw InputError(cameras.where(key) + ": cameras: no camera is named '" + key + "'; the cameras are " +
                       names_of(block) + " (and 'default' for all, 'grouping')");
}

std::string mask_file_name(const std::string& camera) {
  std::string name = camera;
  std::replace(name.begin(), name.end(), '/', '_');
  return name + ".png";
}

void read_masks(const std::string& folder, Project& project) {
  std::vector<std::string> used;
  for (Camera& camera : project.block.cameras) {
    const std::string path = (fs::path(folder) / mask_file_name(camera.name)).string();
    if (!fs::is_regular_file(path)) continue;
    used.push_back(path);
    if (camera.mask_path.empty()) camera.mask_path = path;
    check_mask(camera, project.file);
  }
  for (const auto& item : fs::directory_iterator(folder))
    if (item.path().extension() == ".png" && !item.path().filename().string().starts_with("._") &&
        std::find(used.begin(), used.end(), item.path().string()) == used.end())
      project.warnings.push_back("mask '" + item.path().string() +
                                 "' is not used, because its name is not that of a camera; the cameras are " +
                                 names_of(project.block));
}

}  // namespace megablock
