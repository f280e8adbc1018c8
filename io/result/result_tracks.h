// The tracks of result/block.h5 (docs/reference/file-formats.md, "Result"), batch behind batch. Internal to io/.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "io/result/result.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

// Throws ComputeError unless a column of a result to be written is as long as it must be.
void require_size(std::size_t found, std::size_t expected, const char* what);

// Writes points and observations: all batches, then `finish`. The first one that is not empty says which optional
// columns there are. Errors: as Hdf5Writer; ComputeError when columns of a batch differ in length.
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
  std::vector<Eigen::Vector3d> waiting_;  // points of a box that is not full
  std::vector<float> boxes_;
};

// Number of tracks; all columns must be as long as there are tracks or observations (else StoreError).
std::int64_t count_result_tracks(const Hdf5Reader& file);

// Some successive tracks.
TrackResults read_result_tracks(const Hdf5Reader& file, const RowRange& rows_of_points);

}  // namespace megablock
