// The measurement store: a block's observations of tie points by image and by place, from the few parts of the job's
// files that hold them, so that the size of the block hardly matters (docs/reference/file-formats.md, "Measurements").
//
// By image: `measurements.h5` tells the tiles an image is seen in; the image column of a tile's file of tracks is its
// index by image. By place: `points/district` and `points/box` of the result tell where the points of runs of
// rows lie; places are the adjusted ones. Nothing is stored twice.
//
// Errors: InputError when the job holds no tracks (no result); StoreError when files are damaged or older than those
// they are made of.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "io/block/tracks.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/job/job_store.h"

namespace megablock {

// One row per measurement, all of one length.
struct Measurements {
  std::vector<ImageIndex> image;
  std::vector<TrackIndex> track;            // as in the file of the tile
  std::vector<std::int32_t> x, y, feature;  // as in TrackSet
  std::vector<TileIndex> tile;              // that owns the track
  // By place only:
  std::vector<std::uint8_t> kept;             // 1: takes part in the adjustment
  std::vector<float> residual_x, residual_y;  // adjusted minus measured, px

  std::int64_t size() const { return static_cast<std::int64_t>(image.size()); }
};

struct GroundPlace {
  Eigen::Vector3d centre;  // ground frame, m; up NaN: distances are horizontal
  double radius_m = 0;
};

class MeasurementStore {
 public:
  explicit MeasurementStore(const std::string& job);

  // By names; InputError names the first that is not there.
  std::vector<ImageIndex> find_images(const std::vector<std::string>& names) const;
  std::vector<ImageIndex> images_of_frames(const std::vector<std::string>& names) const;
  // Of images in ascending order.
  std::vector<std::string> names_of(const std::vector<ImageIndex>& images) const;

  // In the order of image, then of tile, then of track; images without measurements have no rows.
  Measurements of_images(std::vector<ImageIndex> images) const;
  // Of the points of the result within the radius, in the order of its points; rejected ones too.
  Measurements near(const GroundPlace& place) const;
  // Where the points of the result lie, ground frame, m, to the digits of a float; empty: none has a position.
  Eigen::AlignedBox3d extent() const;

 private:
  std::vector<TileIndex> tiles_of(const std::vector<ImageIndex>& images) const;
  const Hdf5Reader& result() const;
  std::vector<std::int64_t> points_near(const GroundPlace& place) const;

  JobStore store_;
  // Opened by the first question that needs them.
  mutable std::unique_ptr<Hdf5Reader> index_, result_;
};

// Brings the index by image up to date with the files of the tiles, in tile order, that tracks/index.txt lists.
// Returns what was wrong with the index that was there, if it was damaged.
std::string update_measurement_index(const JobStore& store, const std::vector<std::string>& tiles);

// Throws StoreError when the index by image is not that of the files of tracks as they are.
void check_measurement_index(const JobStore& store);

// The index by place of the result: bounds of the positions of each run of successive points (points/box) and of each
// district of runs (points/district): six numbers (lowest east, north, up; highest) rounded outwards; points without
// position count for nothing, NaN: no point at all.
inline constexpr std::int64_t kPointRun = 1024, kDistrictRuns = 64;
std::vector<float> boxes_of(const std::vector<Eigen::Vector3d>& points);
// Of the unions of kDistrictRuns successive boxes.
std::vector<float> districts_of(const std::vector<float>& boxes);

}  // namespace megablock
