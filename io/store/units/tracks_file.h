// Stores the tracks of a tile in a file (shapes, types and units: docs/reference/file-formats.md, "Tracks").
//
// The writer makes a plain HDF5 file at `path`, which JobStore::write seals. The reader throws StoreError with the name
// of the file.
#pragma once

#include <string>

#include "io/block/tracks.h"

namespace megablock {

void write_tracks(const std::string& path, const TrackSet& tracks);
TrackSet read_tracks(const std::string& path);

}  // namespace megablock
