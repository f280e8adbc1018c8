// Writes a file of tracks in batches, for a block whose tracks do not fit into memory (docs/reference/file-formats.md,
// "Tracks").
#pragma once

#include <memory>
#include <string>

#include "io/block/tracks.h"

namespace megablock {

class TrackWriter {
 public:
  // Creates the file. All functions throw as Hdf5Writer does.
  explicit TrackWriter(const std::string& path);
  // Without close(), as after an exception, no file remains.
  ~TrackWriter();

  // Appends tracks. Their global indices must ascend, within the batch and from batch to batch.
  void append(const TrackSet& batch);
  // Completes the file. read_tracks then returns the batches one after the other.
  void close();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace megablock
