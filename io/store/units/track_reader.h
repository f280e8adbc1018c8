// Reads parts of a file of tracks (docs/reference/file-formats.md, "Tracks"): the column of images, by which
// observations are found, and the coordinates of some rows.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/block/tracks.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

class TrackReader {
 public:
  // All functions throw as Hdf5Reader does.
  explicit TrackReader(const std::string& path) : file_(path, "tracks") {}

  // All tracks with the images of all observations; x, y and feature remain empty.
  TrackSet images() const;

  // Visits all tracks in order, in batches of whole tracks with about this number of observations. The x, y and feature
  // of a batch are read if wanted(row of its first track, number of tracks) is true; otherwise they remain empty.
  using Wanted = std::function<bool(std::int64_t, std::int64_t)>;
  void visit(
      const std::function<void(const TrackSet&)>& take,
      const Wanted& wanted = [](std::int64_t, std::int64_t) { return true; },
      std::int64_t batch_observations = std::int64_t{1} << 18) const;

  // The observations in some images (ascending), in the order of the rows. It reads and keeps less than images().
  struct Found {
    std::vector<std::int64_t> row;
    std::vector<ImageIndex> image;
    std::vector<TrackIndex> track;
  };
  Found find(const std::vector<ImageIndex>& images) const;

  // The coordinates of some rows of the observations, one range after the other.
  struct Measured {
    std::vector<std::int32_t> x, y, feature;  // as in TrackSet
  };
  Measured measured(const std::vector<RowRange>& ranges) const;

 private:
  Hdf5Reader file_;
};

}  // namespace megablock
