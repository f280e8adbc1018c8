#include "io/exchange/colmap/import_colmap.h"

#include <algorithm>
#include <tuple>

namespace megablock {

const ColmapCameraForm& colmap_camera_form(const std::string& name,
                                           const std::function<void(const std::string&)>& fail) {
  const auto& all = colmap_camera_forms();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const ColmapCameraForm& form) { return form.name == name; });
  if (found == all.end()) {
    std::string list;
    for (const ColmapCameraForm& form : all) list += (list.empty() ? "" : ", ") + form.name;
    fail("camera model '" + name + "' is not supported; the models are " + list);
  }
  return *found;
}

void ColmapBuilder::add_point(std::int64_t id, const Eigen::Vector3d& position) {
  if (!points_.emplace(id, position).second) fail("point " + std::to_string(id) + " appears twice");
}

void ColmapBuilder::add_camera(std::int64_t id, const ColmapCameraForm& form, std::int64_t width, std::int64_t height,
                               const std::vector<double>& parameters) {
  const std::string which = "camera " + std::to_string(id);
  constexpr std::int64_t kLargest = 1 << 20;
  if (width < 1 || height < 1 || width > kLargest || height > kLargest)
    fail("the size of " + which + ", " + std::to_string(width) + " x " + std::to_string(height) + ", cannot be right");
  Camera camera;
  camera.name = which;
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  const CameraFromColmap converted = from_colmap(form, parameters);
  if (!converted.refusal.empty()) fail(which + " " + converted.refusal);
  camera.intrinsics = converted.intrinsics;
  if (!(camera.intrinsics[kFocal] > 0)) fail("the focal length of " + which + " is not positive");
  ParameterMask estimated = usual_parameters(CameraModel{form.kind});
  // COLMAP has estimated two focal lengths, so the affinity is estimated here as well.
  if (const auto p = find_parameter(camera.intrinsics.model(), "b1"); p && camera.intrinsics[*p] != 0)
    estimated |= mask_of(*p);
  camera.prior_sigma = weak_sigmas(camera.intrinsics, 0.05 * camera.intrinsics[kFocal], camera.width, estimated);
  camera.focal_known = true;
  Block& block = imported_.block;
  if (!cameras_.emplace(id, block.cameras.next_index()).second) fail(which + " appears twice");
  block.rigs.push_back({camera.name, {Mount{block.cameras.next_index(), {}}}});
  block.cameras.push_back(std::move(camera));
}

void ColmapBuilder::add_image(std::int64_t id, const std::array<double, 4>& q, const Eigen::Vector3d& translation,
                              std::int64_t camera, const std::string& name) {
  const std::string which = "image " + std::to_string(id);
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  // Written with few digits, a quaternion is not exactly a unit one.
  if (!(std::abs(rotation.norm() - 1) <= 1e-3)) fail("the rotation of " + which + " is not a unit quaternion");
  const auto found = cameras_.find(camera);
  if (found == cameras_.end())
    fail(which + " names a camera, " + std::to_string(camera) + ", that the model does not have");
  if (name.empty()) fail(which + " has no name");
  Block& block = imported_.block;
  Frame frame;
  frame.name = name;
  frame.rig = RigIndex(found->second.value);
  // C = -R' t.
  frame.given_pose = Pose{rotation.normalized(), -(rotation.normalized().conjugate() * translation)};
  block.add_image(name, {block.frames.next_index(), 0, 0});
  block.frames.push_back(std::move(frame));
}

void ColmapBuilder::add_observation(double x, double y, std::int64_t point) {
  if (point < 0) return;
  if (!points_.contains(point))
    fail("an observation names point " + std::to_string(point) + ", which the model does not have");
  observations_.push_back({point, ImageIndex(static_cast<std::int64_t>(imported_.block.images.size()) - 1), x, y});
}

ImportedBlock ColmapBuilder::finish() {
  check(imported_.block);
  imported_.state = initial_state(imported_.block);
  make_tracks();
  return std::move(imported_);
}

// Makes the tracks, ordered by the ids of their points. Of two observations in one image, the first counts.
void ColmapBuilder::make_tracks() {
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

}  // namespace megablock
