// Selects the contents of an export, for all writers: the oriented images with their camera poses, and the points and
// observations. Internal to io/.
#pragma once

#include <vector>

#include "io/result/result.h"

namespace megablock {

struct ExportView {
  const BlockResult& result;
  std::vector<ImageIndex> images;               // the oriented images, ascending
  IndexedVector<ImageIndex, std::int64_t> row;  // row in `images`; -1: not oriented

  // Rows of result.tracks whose point has a position and kept observations in two or more oriented images.
  std::vector<std::int64_t> tracks;
  std::vector<std::int64_t> begin;         // [tracks + 1] into observations
  std::vector<std::int64_t> observations;  // rows of the observations of result.tracks: kept ones in oriented images

  const Image& image(std::int64_t i) const { return result.block.images[images[static_cast<std::size_t>(i)]]; }
  std::string image_name(std::int64_t i) const { return result.block.name_of(images[static_cast<std::size_t>(i)]); }
  CameraIndex camera_index(std::int64_t i) const { return result.block.camera_of(images[static_cast<std::size_t>(i)]); }
  const Intrinsics& intrinsics(std::int64_t i) const { return result.state.cameras[camera_index(i)]; }
  Pose pose(std::int64_t i) const;  // pose of the camera in the ground frame
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

// The view refers to the result, which must outlive it.
ExportView make_export_view(const BlockResult& result);

// The observations of each image (ascending), as compressed sparse rows.
struct ObservationsByImage {
  std::vector<std::int64_t> begin;        // [images + 1]
  std::vector<std::int64_t> observation;  // rows of view.observations
  std::vector<std::int64_t> rank;         // [view.observations] number within the image
};
ObservationsByImage observations_by_image(const ExportView& view);

// For each row of view.observations, the row of its point in view.tracks.
std::vector<std::int64_t> track_of_observation(const ExportView& view);

}  // namespace megablock
