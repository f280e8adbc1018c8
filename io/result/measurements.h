// Finds the tie point observations of images, or those near a place on the ground. Only the necessary parts of the
// job's files are read, so a query takes hardly longer in a large block (docs/reference/file-formats.md,
// "Measurements").
//
// For images, `measurements.h5` lists the tiles with observations in each image; the column of images in the track file
// of a tile then gives the rows. For places, `points/district` and `points/box` of the result bound the adjusted
// positions of runs of points. Points are in the order of the images that see them first, so those of a run lie close
// together and their boxes are small. No observation is stored twice.
//
// Errors: InputError if the job has no tracks (no result, for places); StoreError if files are damaged, or older than
// the files they were made from.
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

// One row per observation. All columns have the same length.
struct Measurements {
  std::vector<ImageIndex> image;
  std::vector<TrackIndex> track;            // index in the file of the tile
  std::vector<std::int32_t> x, y, feature;  // as in TrackSet
  std::vector<TileIndex> tile;              // the tile that owns the track
  // Only from near():
  std::vector<std::uint8_t> kept;             // 1: takes part in the adjustment
  std::vector<float> residual_x, residual_y;  // adjusted minus measured, px

  std::int64_t size() const { return static_cast<std::int64_t>(image.size()); }
};

struct GroundPlace {
  Eigen::Vector3d centre;  // ground frame, metres; if up is NaN, distances are horizontal
  double radius_m = 0;
};

class MeasurementStore {
 public:
  explicit MeasurementStore(const std::string& job);

  // Find images by their names, or by those of their frames. Throw InputError with the first name that does not exist.
  std::vector<ImageIndex> find_images(const std::vector<std::string>& names) const;
  std::vector<ImageIndex> images_of_frames(const std::vector<std::string>& names) const;
  // The names of images, which must be ascending.
  std::vector<std::string> names_of(const std::vector<ImageIndex>& images) const;

  // The observations in some images, ordered by image, then by tile, then by track.
  Measurements of_images(std::vector<ImageIndex> images) const;
  // The observations of all points of the result within the radius, including rejected observations, in the order of
  // the points.
  Measurements near(const GroundPlace& place) const;
  // The bounds of the points of the result (ground frame, metres) with the precision of a float. Empty if no point has
  // a position.
  Eigen::AlignedBox3d extent() const;

 private:
  std::vector<TileIndex> tiles_of(const std::vector<ImageIndex>& images) const;
  const Hdf5Reader& result() const;
  std::vector<std::int64_t> points_near(const GroundPlace& place) const;

  JobStore store_;
  // Opened by the first query that needs them.
  mutable std::unique_ptr<Hdf5Reader> index_, result_;
};

// Updates the index by image from the track files that tracks/index.txt lists (in the order of the tiles). If the old
// index was damaged, returns the damage.
std::string update_measurement_index(const JobStore& store, const std::vector<std::string>& tiles);

// Throws StoreError if the index by image does not belong to the present track files.
void check_measurement_index(const JobStore& store);

// The index by place of the result: the bounds of the positions of each run of kPointRun successive points (points/box)
// and of each district of kDistrictRuns runs (points/district). Each box has six numbers: the lowest east, north, up,
// then the highest, rounded outwards. Points without a position do not count; a box without any point is NaN.
inline constexpr std::int64_t kPointRun = 1024, kDistrictRuns = 64;
std::vector<float> boxes_of(const std::vector<Eigen::Vector3d>& points);
// The bounds of kDistrictRuns successive boxes each.
std::vector<float> districts_of(const std::vector<float>& boxes);

}  // namespace megablock
