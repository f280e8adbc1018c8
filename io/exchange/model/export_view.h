// What the exporters have in common: the oriented images with their camera poses, the points and observations to write.
// Internal to io/.
#pragma once

#include <vector>

#include "io/result/result.h"

namespace megablock {

struct ExportView {
  const BlockResult& result;
  std::vector<ImageIndex> images;               // oriented ones, ascending
  IndexedVector<ImageIndex, std::int64_t> row;  // position in `images`, -1 = not oriented

  // Points: rows of result.tracks whose point is known and seen by two or more oriented images with kept observations.
  std::vector<std::int64_t> tracks;
  std::vector<std::int64_t> begin;         // [tracks + 1] into observations
  std::vector<std::int64_t> observations;  // rows of result.tracks' observations, kept, of oriented images

  const Image& image(std::int64_t i) const { return result.block.images[images[static_cast<std::size_t>(i)]]; }
  std::string image_name(std::int64_t i) const { return result.block.name_of(images[static_cast<std::size_t>(i)]); }
  CameraIndex camera_index(std::int64_t i) const { return result.block.camera_of(images[static_cast<std::size_t>(i)]); }
  const Intrinsics& intrinsics(std::int64_t i) const { return result.state.cameras[camera_index(i)]; }
  Pose pose(std::int64_t i) const;  // of the camera in the ground frame
  std::int64_t image_of(std::int64_t observation) const {
    return row[result.tracks.image[static_cast<std::size_t>(observation)]];
  }
  Eigen::Vector2d pixel(std::int64_t observation) const;
  const Eigen::Vector3d& point(std::int64_t t) const {
    return result.points[static_cast<std::size_t>(tracks[static_cast<std::size_t>(t)])];
  }
  std::int64_t image_count() const { return static_cast<std::int64_t>(images.size()); }
  std::int64_t track_count() const { return static_cast<std::int64_t>(tracks.size()); }
};

ExportView make_export_view(const BlockResult& result);

// Observations by image (rows of view.observations, ascending), compressed rows.
struct ObservationsByImage {
  std::vector<std::int64_t> begin;        // [images + 1]
  std::vector<std::int64_t> observation;  // positions in view.observations
  std::vector<std::int64_t> rank;         // [view.observations] position inside its image
};
ObservationsByImage observations_by_image(const ExportView& view);

// Point of each position in view.observations (position in view.tracks).
std::vector<std::int64_t> track_of_observation(const ExportView& view);

}  // namespace megablock
