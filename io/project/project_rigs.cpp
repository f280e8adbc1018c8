// Reads OpenSfM's rig files and joins the images of each exposure into a frame. The pose of a rig camera in these files
// is X_cam = R X_rig + t, with R as a rotation vector; our mount thus has the rotation R and the centre -R' t. All
// exposures belong to one rig. Its mounts are the rig cameras with images, in the order of the file; the first of them
// is the reference of the rig and is held.
#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "io/base/error.h"
#include "io/project/project_sections.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

using OrderedJson = nlohmann::ordered_json;  // keeps the order of the file

constexpr double kPositionSigma = 0.05, kRotationSigmaDeg = 1;  // defaults for a mount

struct RigCamera {
  std::string name;
  Pose pose;
};

struct Exposure {
  std::string name;                                         // empty: the frame has the name of its first image
  std::vector<std::pair<std::string, std::string>> images;  // image, rig camera
};

OrderedJson read_json(const std::string& path) {
  std::ifstream stream(path);
  try {
    return OrderedJson::parse(stream);
  } catch (const OrderedJson::exception& error) {
    throw InputError(path + ": not valid JSON: " + error.what());
  }
}

Eigen::Vector3d vector_of(const OrderedJson& object, const char* key, const std::string& where) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  if (found == object.end() || !found->is_array() || found->size() != 3)
    throw InputError(where + ": '" + key + "' must be a list of 3 numbers");
  Eigen::Vector3d v;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!(*found)[i].is_number()) throw InputError(where + ": '" + key + "' must be a list of 3 numbers");
    v[static_cast<Eigen::Index>(i)] = (*found)[i].get<double>();
  }
  return v;
}

std::vector<RigCamera> read_rig_cameras(const std::string& path) {
  const OrderedJson json = read_json(path);
  if (!json.is_object() || json.empty()) throw InputError(path + ": expected an object of rig cameras by name");
  std::vector<RigCamera> cameras;
  for (const auto& [name, value] : json.items()) {
    const std::string where = path + ": rig camera '" + name + "'";
    const Eigen::Vector3d turn = vector_of(value, "rotation", where);
    check_rotation_vector(turn, "rotation", where);
    const Eigen::Quaterniond rotation = rotation_exp<double>(turn).normalized();
    const Eigen::Vector3d translation = vector_of(value, "translation", where);
    check_on_vehicle(translation, "translation", where);
    cameras.push_back({name, {rotation, -(rotation.conjugate() * translation)}});
  }
  return cameras;
}

Exposure read_exposure(const OrderedJson& list, const std::string& name, const std::string& where) {
  Exposure exposure{name, {}};
  if (!list.is_array()) throw InputError(where + " must be a list of [image, rig camera]");
  for (const OrderedJson& pair : list) {
    if (!pair.is_array() || pair.size() != 2 || !pair[0].is_string() || !pair[1].is_string())
      throw InputError(where + " must be a list of [image, rig camera]");
    exposure.images.emplace_back(pair[0].get<std::string>(), pair[1].get<std::string>());
  }
  return exposure;
}

// Reads the exposures: a JSON list, or an object that gives each exposure a name.
std::vector<Exposure> read_exposures(const std::string& path) {
  const OrderedJson json = read_json(path);
  if (!json.is_array() && !json.is_object()) throw InputError(path + ": expected a list of rig exposures");
  std::vector<Exposure> exposures;
  std::int64_t number = 0;
  for (const auto& [key, list] : json.items())
    exposures.push_back(
        read_exposure(list, json.is_object() ? key : "", path + ": exposure " + std::to_string(++number)));
  return exposures;
}

class RigBuilder {
 public:
  RigBuilder(const std::string& cameras_file, const std::string& assignments_file, const Project& project)
      : assignments_file_(assignments_file),
        cameras_(read_rig_cameras(cameras_file)),
        exposures_(read_exposures(assignments_file)),
        old_(project.block) {
    for (std::size_t i = 0; i < old_.images.size(); ++i) {
      const ImageIndex image(static_cast<std::int64_t>(i));
      images_.emplace(old_.name_of(image), image);
    }
    for (const auto& [name, reason] : project.unreadable) left_out_.push_back(name);
    left_out_.insert(left_out_.end(), project.copies.begin(), project.copies.end());
  }

  // To be called after build(): assigned images that do not exist, and named exposures all of whose images are missing.
  std::vector<std::string> missing() const {
    std::vector<std::string> names = missing_;
    for (const Exposure& exposure : exposures_)
      if (!exposure.name.empty() && std::all_of(exposure.images.begin(), exposure.images.end(), [&](const auto& image) {
            return std::find(missing_.begin(), missing_.end(), image.first) != missing_.end();
          }))
        names.push_back(exposure.name);
    return names;
  }
  std::string warning() const {
    std::size_t images = 0;
    for (const Exposure& exposure : exposures_) images += exposure.images.size();
    return assignments_file_ + ": " + std::to_string(missing_.size()) + " of " + std::to_string(images) +
           " images are not in the folder of images, '" + missing_.front() +
           "' for example; their frames are built without them. Restore them, or remove them from the file";
  }

  // Returns the block with one frame per exposure. Images keep their order; frames are ordered by their first images.
  Block build(double position_sigma_m, double rotation_sigma_rad) {
    assign();
    Block block = old_;
    block.rigs.clear();
    block.frames.clear();
    // Without a held mount, a common motion of all mounts could be exchanged with the poses of the frames.
    const int reference = *std::min_element(used_.begin(), used_.end());
    block.rigs.push_back({"rig", {}});
    std::map<int, int> mount_of_camera;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const int camera = static_cast<int>(c);
      if (std::find(used_.begin(), used_.end(), camera) == used_.end()) continue;
      mount_of_camera[camera] = static_cast<int>(mount_of_camera.size());
      const bool held = camera == reference;
      block.rigs.front().mounts.push_back(
          {camera_of_.at(camera), cameras_[c].pose, held ? 0 : rotation_sigma_rad, held ? 0 : position_sigma_m});
    }
    add_frames(mount_of_camera, block);
    return block;
  }

 private:
  struct Place {
    std::size_t exposure;
    int rig_camera;
  };

  [[noreturn]] void fail(const std::string& message) const { throw InputError(assignments_file_ + ": " + message); }

  int rig_camera_named(const std::string& name, const std::string& image) const {
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      if (cameras_[c].name == name) return static_cast<int>(c);
    fail("image '" + image + "' is assigned to rig camera '" + name + "', which the file of rig cameras does not have");
  }

  void assign() {
    for (std::size_t e = 0; e < exposures_.size(); ++e)
      for (const auto& [name, rig_camera] : exposures_[e].images) {
        const int camera = rig_camera_named(rig_camera, name);
        if (std::find(left_out_.begin(), left_out_.end(), name) != left_out_.end()) continue;
        const auto image = images_.find(name);
        if (image == images_.end()) {
          missing_.push_back(name);
          continue;
        }
        if (!places_.emplace(image->second, Place{e, camera}).second)
          fail("image '" + name + "' is assigned twice; keep one of the assignments");
        // A mount belongs to one physical camera, so that its calibration is one set of unknowns.
        const auto [known, inserted] = camera_of_.emplace(camera, old_.camera_of(image->second));
        if (known->second != old_.camera_of(image->second))
          fail("rig camera '" + rig_camera + "' has images of two cameras ('" + old_.cameras[known->second].name +
               "' and, in image '" + name + "', '" + old_.cameras[old_.camera_of(image->second)].name +
               "'); group them with cameras: {grouping: folder} or check the assignment");
        if (inserted) used_.push_back(camera);
      }
    if (places_.empty())
      fail("no image of the block is assigned" +
           (missing_.empty() ? std::string()
                             : "; '" + missing_.front() + "', for example, is not in the folder of images"));
  }

  void add_frames(const std::map<int, int>& mount_of_camera, Block& block) const {
    std::map<std::size_t, FrameIndex> frame_of_exposure;
    std::map<CameraIndex, RigIndex> single;  // rigs of the images that belong to no exposure
    for (std::size_t i = 0; i < block.images.size(); ++i) {
      const ImageIndex index(static_cast<std::int64_t>(i));
      Image& image = block.images[index];
      Frame frame = old_.frames[image.frame];
      const auto place = places_.find(index);
      if (place == places_.end()) {
        const CameraIndex camera = old_.camera_of(index);
        const auto [rig, inserted] = single.emplace(camera, block.rigs.next_index());
        if (inserted) block.rigs.push_back({block.cameras[camera].name, {Mount{camera, {}}}});
        frame.rig = rig->second;
        image.frame = block.frames.next_index();
        block.frames.push_back(frame);
        continue;
      }
      const auto [found, inserted] = frame_of_exposure.emplace(place->second.exposure, block.frames.next_index());
      image.frame = found->second;
      image.mount = mount_of_camera.at(place->second.rig_camera);
      if (!inserted) continue;
      frame.rig = RigIndex(0);
      const std::string& name = exposures_[place->second.exposure].name;
      if (!name.empty()) frame.name = name;
      block.frames.push_back(frame);
    }
  }

  std::string assignments_file_;
  std::vector<RigCamera> cameras_;
  std::vector<Exposure> exposures_;
  Block old_;
  std::map<std::string, ImageIndex> images_;
  std::vector<std::string> left_out_, missing_;
  std::map<ImageIndex, Place> places_;
  std::map<int, CameraIndex> camera_of_;  // [rig cameras with images]
  std::vector<int> used_;
};

}  // namespace

void read_rigs(YamlReader& top, Project& project) {
  auto reader = top.mapping("rigs");
  if (!reader) return;
  const auto cameras = reader->existing_file("cameras"), assignments = reader->existing_file("assignments");
  if (!cameras || !assignments)
    throw InputError(reader->where() +
                     ": rigs needs 'cameras' and 'assignments' (OpenSfM's rig_cameras.json and "
                     "rig_assignments.json)");
  const double position = reader->number("sigma_position_m").value_or(kPositionSigma);
  const double rotation = reader->number("sigma_rotation_deg").value_or(kRotationSigmaDeg);
  if (position < 0 || rotation < 0 || (position == 0) != (rotation == 0))
    throw InputError(reader->where() +
                     ": rigs: sigma_position_m and sigma_rotation_deg must both be positive, or both 0 "
                     "(mounts held)");
  if (position > 0) {
    check_within(position, kSigmaMetres, "rigs.sigma_position_m", reader->where("sigma_position_m"));
    check_within(rotation, kSigmaDegrees, "rigs.sigma_rotation_deg", reader->where("sigma_rotation_deg"));
  }
  reader->finish();
  RigBuilder builder(*cameras, *assignments, project);
  project.block = builder.build(position, rotation * std::numbers::pi / 180);
  project.missing = builder.missing();
  if (!project.missing.empty()) project.warnings.push_back(builder.warning());
}

std::optional<ApproximatePoses> read_poses(YamlReader& top) {
  const auto path = top.existing_file("poses");
  if (!path) return std::nullopt;
  return read_approximate_poses(*path);
}

}  // namespace megablock
