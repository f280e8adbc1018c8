// Writes and reads the tracks of result/block.h5 in batches (docs/reference/file-formats.md, "Result"). Internal to
// io/.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "io/result/result.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

// Throws ComputeError if a column of a result that is to be written has the wrong length.
void require_size(std::size_t found, std::size_t expected, const char* what);

// Writes points and observations. All batches are appended, then finish() is called. The first batch that is not empty
// decides on the optional columns of the file. Throws as Hdf5Writer does, and ComputeError if the columns of a batch
// differ in length.
class ResultTrackWriter {
 public:
  explicit ResultTrackWriter(Hdf5Writer& file);
  void append(const TrackResults& batch);
  void finish();

 private:
  void add_optional_columns(const TrackResults& batch);
  void add_boxes(const std::vector<Eigen::Vector3d>& more, bool last = false);

  Hdf5Writer& file_;
  bool first_ = true;
  std::int64_t observations_ = 0;
  std::vector<Eigen::Vector3d> waiting_;  // points of the box that is not yet full
  std::vector<float> boxes_;
};

// Returns the number of tracks. Throws StoreError if a column is not as long as the number of tracks or observations.
std::int64_t count_result_tracks(const Hdf5Reader& file);

// Reads some successive tracks.
TrackResults read_result_tracks(const Hdf5Reader& file, const RowRange& rows_of_points);

}  // namespace megablock
