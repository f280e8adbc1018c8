#include "io/project/append.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <string_view>
#include <unordered_map>

#include "io/block/ground_change.h"
namespace megablock {

namespace {

// Appends both lists of named items to `merged`, each name once. Returns the index in `merged` of each item of `now`.
template <typename Index, typename Item>
IndexedVector<Index, Index> places_by_name(const IndexedVector<Index, Item>& previous,
                                           const IndexedVector<Index, Item>& now, IndexedVector<Index, Item>& merged) {
  std::map<std::string, Index> place;
  for (const Item& item : previous) {
    place.emplace(item.name, merged.next_index());
    merged.push_back(item);
  }
  IndexedVector<Index, Index> places;
  for (const Item& item : now) {
    const auto [found, inserted] = place.emplace(item.name, merged.next_index());
    if (inserted) merged.push_back(item);
    places.push_back(found->second);
  }
  return places;
}

IndexedVector<ImageIndex, ImageIndex> places_of_images(const Block& previous, const Block& now, Block& merged) {
  std::unordered_map<std::string, ImageIndex> place;
  for (ImageIndex i(0); previous.images.contains(i); ++i.value)
    place.emplace(previous.name_of(i), merged.add_image(previous.image_names[i], previous.images[i]));
  IndexedVector<ImageIndex, ImageIndex> places;
  for (ImageIndex i(0); now.images.contains(i); ++i.value) {
    const auto [found, inserted] = place.emplace(now.name_of(i), merged.images.next_index());
    if (inserted) merged.add_image(now.image_names[i], now.images[i]);
    places.push_back(found->second);
  }
  return places;
}

void move(const GroundChange& change, Block& block) {
  for (Frame& frame : block.frames) {
    if (frame.position_prior) frame.position_prior->position = change.position(frame.position_prior->position);
    if (frame.attitude_prior) frame.attitude_prior->rotation_cw = change.rotation(frame.attitude_prior->rotation_cw);
    if (frame.given_pose) frame.given_pose = change.pose(*frame.given_pose);
  }
  for (ControlPoint& point : block.control_points)
    if (point.position.allFinite()) point.position = change.position(point.position);
}

// The transformation into another ground frame and back rounds. A value that agrees with the former one to a fraction
// of a micrometre therefore keeps the former bits. Otherwise everything computed from it would count as out of date.
bool agrees(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return (a - b).norm() < 1e-6; }
bool agrees(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) { return rotation_angle(a, b) < 1e-9; }

void keep_former_bits(const Block& previous, Block& moved) {
  std::map<std::string, const Frame*> frames;
  for (const Frame& frame : previous.frames) frames.emplace(frame.name, &frame);
  for (Frame& frame : moved.frames) {
    const auto found = frames.find(frame.name);
    if (found == frames.end()) continue;
    const Frame& former = *found->second;
    if (frame.position_prior && former.position_prior &&
        agrees(frame.position_prior->position, former.position_prior->position))
      frame.position_prior->position = former.position_prior->position;
    if (frame.attitude_prior && former.attitude_prior &&
        agrees(frame.attitude_prior->rotation_cw, former.attitude_prior->rotation_cw) &&
        agrees(frame.attitude_prior->sigma_rad, former.attitude_prior->sigma_rad))
      frame.attitude_prior = former.attitude_prior;
    if (frame.given_pose && former.given_pose && agrees(frame.given_pose->centre, former.given_pose->centre) &&
        agrees(frame.given_pose->rotation, former.given_pose->rotation))
      frame.given_pose = former.given_pose;
  }
  std::map<std::string, const ControlPoint*> points;
  for (const ControlPoint& point : previous.control_points) points.emplace(point.name, &point);
  for (ControlPoint& point : moved.control_points) {
    const auto found = points.find(point.name);
    if (found != points.end() && agrees(point.position, found->second->position))
      point.position = found->second->position;
  }
}

template <typename Index, typename Item>
bool same_names(const IndexedVector<Index, Item>& a, const IndexedVector<Index, Item>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Item& x, const Item& y) { return x.name == y.name; });
}

bool same_image_names(const Block& a, const Block& b) {
  if (a.images.size() != b.images.size()) return false;
  for (ImageIndex i(0); a.images.contains(i); ++i.value)
    if (a.image_names[i] != b.image_names[i]) return false;
  return true;
}

// Whether every item has its index already. This is the usual case: a job is resumed without new images.
bool same_places(const Block& a, const Block& b, const std::function<void()>& after_table) {
  if (!same_names(a.cameras, b.cameras) || !same_names(a.rigs, b.rigs) || !same_names(a.frames, b.frames)) return false;
  after_table();
  return same_image_names(a, b);
}

void sort_verticals(Block& block) {
  std::sort(block.verticals.begin(), block.verticals.end(),
            [](const SeenVertical& a, const SeenVertical& b) { return a.image < b.image; });
}

}  // namespace

bool has_all_images_of(const Block& previous, const Block& now) {
  if (same_image_names(previous, now)) return true;
  std::vector<std::string_view> names;
  names.reserve(now.images.size());
  for (ImageIndex i(0); now.images.contains(i); ++i.value) names.push_back(now.image_names[i]);
  std::sort(names.begin(), names.end());
  for (ImageIndex i(0); previous.images.contains(i); ++i.value)
    if (!std::binary_search(names.begin(), names.end(), previous.image_names[i])) return false;
  return true;
}

// Groups of positions are those of the project alone: the last rigs of a job are forgotten where they are groups that
// it names no longer. Rigs after them would lose their numbers.
void forget_last_groups(const Block& now, IndexedVector<RigIndex, Rig>& rigs) {
  while (!rigs.empty() && rigs.back().is_group() &&
         std::ranges::find(now.rigs, rigs.back().name, &Rig::name) == now.rigs.end())
    rigs.pop_back();
}

Block append_to(const Block& previous, Block moved, const std::function<void()>& after_table) {
  if (previous.ground.georeferenced && moved.ground.georeferenced && !same_origin(previous.ground, moved.ground)) {
    move(GroundChange(moved.ground, previous.ground), moved);
    keep_former_bits(previous, moved);
  }
  if (previous.ground.georeferenced) moved.ground = previous.ground;
  if (same_places(previous, moved, after_table)) {
    sort_verticals(moved);
    return moved;
  }
  Block merged;
  merged.ground = moved.ground;
  merged.image_folder = moved.image_folder;  // the folder may have been moved since the job began
  // From here each index of `now` goes through the table of its kind: cameras[old index] is the new one.
  const auto cameras = places_by_name(previous.cameras, moved.cameras, merged.cameras);
  IndexedVector<RigIndex, Rig> known = previous.rigs;
  forget_last_groups(moved, known);
  const auto rigs = places_by_name(known, moved.rigs, merged.rigs);
  const auto frames = places_by_name(previous.frames, moved.frames, merged.frames);
  const auto images = places_of_images(previous, moved, merged);
  for (std::size_t i = 0; i < cameras.size(); ++i)
    merged.cameras[cameras.Base::operator[](i)] = moved.cameras.Base::operator[](i);
  for (std::size_t i = 0; i < rigs.size(); ++i) {
    Rig rig = moved.rigs.Base::operator[](i);
    for (Mount& mount : rig.mounts)
      if (mount.camera.valid()) mount.camera = cameras[mount.camera];
    merged.rigs[rigs.Base::operator[](i)] = std::move(rig);
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Frame frame = moved.frames.Base::operator[](i);
    frame.rig = rigs[frame.rig];
    if (frame.position_prior && frame.position_prior->group.valid())
      frame.position_prior->group = rigs[frame.position_prior->group];
    merged.frames[frames.Base::operator[](i)] = std::move(frame);
  }
  for (std::size_t i = 0; i < images.size(); ++i) {
    Image image = moved.images.Base::operator[](i);
    image.frame = frames[image.frame];
    merged.images[images.Base::operator[](i)] = image;
  }
  merged.relative_poses = moved.relative_poses;
  for (RelativePose& relative : merged.relative_poses) {
    relative.from = frames[relative.from];
    relative.to = frames[relative.to];
  }
  merged.frame_measurements = moved.frame_measurements;
  for (auto& [key, measurements] : merged.frame_measurements) {
    for (FrameMeasurement& measurement : measurements) {
      measurement.from = frames[measurement.from];
      measurement.to = frames[measurement.to];
    }
  }
  merged.control_points = moved.control_points;
  for (ControlPoint& point : merged.control_points)
    for (ImageMeasurement& measurement : point.measurements) measurement.image = images[measurement.image];
  merged.lines = moved.lines;
  for (KnownLine& line : merged.lines)
    for (KnownLine::Measurement& measurement : line.measurements) measurement.image = images[measurement.image];
  merged.verticals = moved.verticals;
  for (SeenVertical& vertical : merged.verticals) vertical.image = images[vertical.image];
  sort_verticals(merged);
  return merged;
}

}  // namespace megablock
