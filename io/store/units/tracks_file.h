// Stores the tracks of a tile in a file (shapes, types and units: docs/reference/file-formats.md, "Tracks").
//
// The writer makes a plain HDF5 file at `path`, which JobStore::write seals. The reader throws StoreError with the name
// of the file.
//
// Coding. With the tracks t in ascending order and their observations o in ascending order of images, the file has
// differences instead of values:
//
//     tracks/id_difference           id(t) - id(t - 1), with id(-1) = 0
//     tracks/observations            number of observations of t
//     observations/image_difference  image(o) - image(o - 1) within a track; for the first o of t it is the image minus
//                                    the first image of t - 1 (0 before the first track)
//
// Neighbouring tracks begin in neighbouring images, so most differences are small numbers, which deflate stores in a
// fraction of the space. Coordinates are integers in units of 2^-10 px and have no such pattern.
#pragma once

#include <string>

#include "io/block/tracks.h"

namespace megablock {

void write_tracks(const std::string& path, const TrackSet& tracks);
TrackSet read_tracks(const std::string& path);

}  // namespace megablock
