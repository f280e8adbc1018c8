#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <tuple>

#include "io/import_bal.h"
#include "io/number_reader.h"

namespace megablock {

namespace {

constexpr std::int64_t kMany = std::int64_t{1} << 40;

// Where the parameters of a COLMAP model belong; "fx" and "fy" must agree.
const std::map<std::string, std::vector<std::string>>& models() {
  static const std::map<std::string, std::vector<std::string>> all = {
      {"SIMPLE_PINHOLE", {"f", "cx", "cy"}},
      {"PINHOLE", {"fx", "fy", "cx", "cy"}},
      {"SIMPLE_RADIAL", {"f", "cx", "cy", "k1"}},
      {"RADIAL", {"f", "cx", "cy", "k1", "k2"}},
      {"OPENCV", {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}},
      {"FULL_OPENCV", {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}}};
  return all;
}

void skip_comments(NumberReader& reader, auto&& read_line) {
  while (!reader.at_end()) {
    const std::string first(reader.word("a line"));
    if (first.starts_with('#'))
      reader.rest_of_line();
    else
      read_line(first);
  }
}

std::int64_t parse_id(NumberReader& reader, const std::string& word, const char* what) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || value < 0)
    reader.fail(std::string(what) + ": '" + word + "' is not a whole number");
  return value;
}

Camera read_camera(NumberReader& reader, std::int64_t id) {
  Camera camera;
  camera.name = "camera " + std::to_string(id);
  const std::string model(reader.word("a camera's model"));
  const auto found = models().find(model);
  if (found == models().end()) {
    std::string list;
    for (const auto& [name, parameters] : models()) list += (list.empty() ? "" : ", ") + name;
    reader.fail("camera model '" + model + "' is not supported; the models are " + list);
  }
  camera.width = static_cast<int>(reader.integer("a camera's width", 1, 1 << 20));
  camera.height = static_cast<int>(reader.integer("a camera's height", 1, 1 << 20));
  double fx = 0;
  for (const std::string& name : found->second) {
    const double value = reader.number("a camera's parameters");
    if (name == "fx") fx = value;
    if (name == "fy" && std::abs(value - fx) > 1e-9 * std::abs(fx))
      reader.fail("camera " + std::to_string(id) + " has fx " + std::to_string(fx) + " and fy " +
                  std::to_string(value) + "; only square pixels (fx = fy) are supported");
    if ((name == "k4" || name == "k5" || name == "k6") && value != 0)
      reader.fail("camera " + std::to_string(id) + " uses " + name + ", which is not supported");
    const std::string ours = name == "fx" || name == "fy" ? "f" : name;
    for (std::size_t p = 0; p < kIntrinsicCount; ++p)
      if (ours == kIntrinsicNames[p]) camera.intrinsics[p] = value;
  }
  if (!(camera.intrinsics[kFocal] > 0))
    reader.fail("the focal length of camera " + std::to_string(id) + " is not positive");
  const double principal = 0.02 * camera.width;
  camera.prior_sigma = {0.05 * camera.intrinsics[kFocal], principal, principal, 0.2, 0.2, 0.2, 0.01, 0.01};
  camera.focal_known = true;
  return camera;
}

class ColmapReader {
 public:
  explicit ColmapReader(const std::string& folder) : folder_(folder) {}

  ImportedBlock read() {
    read_points();
    read_cameras();
    read_images();
    check(imported_.block);
    imported_.state = initial_state(imported_.block);
    make_tracks();
    return std::move(imported_);
  }

 private:
  struct Observation {
    std::int64_t point;
    ImageIndex image;
    double x, y;
  };

  std::string file(const char* name) const { return (std::filesystem::path(folder_) / name).string(); }

  void read_points() {
    NumberReader reader(file("points3D.txt"));
    skip_comments(reader, [&](const std::string& first) {
      Eigen::Vector3d point;
      for (double& value : point) value = reader.number("a point's coordinates");
      reader.rest_of_line();  // colour, error; the track comes from the images
      if (!points_.emplace(parse_id(reader, first, "a point's id"), point).second)
        reader.fail("point " + first + " appears twice");
    });
  }

  void read_cameras() {
    NumberReader reader(file("cameras.txt"));
    skip_comments(reader, [&](const std::string& first) {
      const std::int64_t id = parse_id(reader, first, "a camera's id");
      if (!cameras_.emplace(id, imported_.block.cameras.next_index()).second)
        reader.fail("camera " + first + " appears twice");
      Camera camera = read_camera(reader, id);
      imported_.block.rigs.push_back({camera.name, {Mount{imported_.block.cameras.next_index(), {}}}});
      imported_.block.cameras.push_back(std::move(camera));
      reader.rest_of_line();
    });
  }

  void read_images() {
    NumberReader reader(file("images.txt"));
    skip_comments(reader, [&](const std::string& first) {
      parse_id(reader, first, "an image's id");
      double q[4];
      Eigen::Vector3d translation;
      for (double& value : q) value = reader.number("an image's rotation");
      for (double& value : translation) value = reader.number("an image's translation");
      const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
      if (std::abs(rotation.norm() - 1) > 1e-3)
        reader.fail("the rotation of image " + first + " is not a unit quaternion");
      const auto camera = cameras_.find(reader.integer("an image's camera", 0, kMany));
      if (camera == cameras_.end()) reader.fail("image " + first + " names a camera that cameras.txt does not have");
      const std::string name(reader.rest_of_line());
      if (name.empty()) reader.fail("image " + first + " has no name");
      add_image(name, camera->second, rotation.normalized(), translation);
      while (reader.line_has_more()) read_observation(reader);
      reader.rest_of_line();
    });
  }

  void add_image(const std::string& name, CameraIndex camera, const Eigen::Quaterniond& rotation,
                 const Eigen::Vector3d& translation) {
    Block& block = imported_.block;
    Frame frame;
    frame.name = name;
    frame.rig = RigIndex(camera.value);
    frame.given_pose = Pose{rotation, -(rotation.conjugate() * translation)};
    block.images.push_back({name, "", block.frames.next_index(), 0, 0});
    block.frames.push_back(std::move(frame));
  }

  void read_observation(NumberReader& reader) {
    Observation o;
    o.x = reader.number("x of an observation");
    o.y = reader.number("y of an observation");
    o.point = reader.integer("point of an observation", -1, kMany);
    o.image = ImageIndex(static_cast<std::int64_t>(imported_.block.images.size()) - 1);
    if (o.point < 0) return;
    if (!points_.contains(o.point))
      reader.fail("an observation names point " + std::to_string(o.point) + ", which points3D.txt does not have");
    observations_.push_back(o);
  }

  // Tracks in the order of the points' ids; of two observations in one image the first counts.
  void make_tracks() {
    std::stable_sort(observations_.begin(), observations_.end(), [](const Observation& a, const Observation& b) {
      return std::tie(a.point, a.image) < std::tie(b.point, b.image);
    });
    TrackSet& tracks = imported_.tracks;
    tracks.begin.push_back(0);
    std::size_t o = 0;
    for (const auto& [id, point] : points_) {
      for (; o < observations_.size() && observations_[o].point == id; ++o) {
        const bool again = static_cast<std::int64_t>(tracks.image.size()) > tracks.begin.back() &&
                           tracks.image.back() == observations_[o].image;
        if (again) continue;
        tracks.image.push_back(observations_[o].image);
        tracks.x.push_back(to_fixed_pixel(observations_[o].x));
        tracks.y.push_back(to_fixed_pixel(observations_[o].y));
        tracks.feature.push_back(-1);
      }
      tracks.id.push_back(TrackIndex(static_cast<std::int64_t>(tracks.id.size())));
      tracks.begin.push_back(static_cast<std::int64_t>(tracks.image.size()));
      imported_.points.push_back(point);
    }
  }

  std::string folder_;
  ImportedBlock imported_;
  std::map<std::int64_t, CameraIndex> cameras_;
  std::map<std::int64_t, Eigen::Vector3d> points_;
  std::vector<Observation> observations_;
};

}  // namespace

ImportedBlock import_colmap_text(const std::string& folder) { return ColmapReader(folder).read(); }

}  // namespace megablock
