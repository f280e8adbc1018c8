// Writes a file of tracks that is too large for memory, batch by batch (docs/job-format.md, "Tracks").
#pragma once

#include <memory>
#include <string>

#include "io/block/tracks.h"

namespace megablock {

class TrackWriter {
 public:
  // Creates the file. Errors of all functions: as Hdf5Writer.
  explicit TrackWriter(const std::string& path);
  // Without close(), as after an exception, no file is left.
  ~TrackWriter();

  // Tracks whose global indices ascend, within the batch and from batch to batch.
  void append(const TrackSet& batch);
  // read_tracks then gives all batches behind one another.
  void close();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace megablock
