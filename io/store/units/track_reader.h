// Reads parts of a file of tracks (docs/job-format.md, "Tracks"): its image column, which is its index by image, and
// the measurements of some rows.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/block/tracks.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

class TrackReader {
 public:
  // Errors of all functions: as Hdf5Reader.
  explicit TrackReader(const std::string& path) : file_(path, "tracks") {}

  // All tracks and the images of all observations; x, y and feature stay empty.
  TrackSet images() const;

  // All tracks in order, in batches of whole tracks with about so many observations; a batch's x, y and feature are
  // read where `wanted` (of its first track's row and number of tracks) says so, else they stay empty.
  using Wanted = std::function<bool(std::int64_t, std::int64_t)>;
  void visit(
      const std::function<void(const TrackSet&)>& take,
      const Wanted& wanted = [](std::int64_t, std::int64_t) { return true; },
      std::int64_t batch_observations = std::int64_t{1} << 18) const;

  // The observations in some images (ascending), in the order of the rows. Reads and keeps less than images().
  struct Found {
    std::vector<std::int64_t> row;
    std::vector<ImageIndex> image;
    std::vector<TrackIndex> track;
  };
  Found find(const std::vector<ImageIndex>& images) const;

  // Of some rows of the observations, range behind range.
  struct Measured {
    std::vector<std::int32_t> x, y, feature;  // as in TrackSet
  };
  Measured measured(const std::vector<RowRange>& ranges) const;

 private:
  Hdf5Reader file_;
};

}  // namespace megablock
