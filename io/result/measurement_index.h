// Gives the names in the index by image, which its writer and its readers share. Internal to io/.
//
// measurements.h5 is a sparse matrix of images and tiles in compressed rows: image i has observations in the tiles
// images/tile[begin[i]] to images/tile[begin[i + 1] - 1]. It also stores the fingerprints of the track files of which
// it was made, so that a reader sees when one of them is newer.
#pragma once

#include <cstdint>
#include <string>

#include "io/base/index.h"
#include "io/store/job/job_store.h"

namespace megablock {

inline constexpr const char *kTrackList = "tracks/index.txt", *kMeasurementIndex = "measurements.h5";
inline constexpr const char *kMeasurementIndexKind = "measurement_index", *kTileFingerprint = "tiles/fingerprint",
                            *kImageBegin = "images/begin", *kImageTile = "images/tile";

std::string tracks_unit(TileIndex tile);  // "tracks/000003.h5"

// The fingerprint of an index of the track files that this list names.
std::uint64_t measurement_index_fingerprint(const UnitSeal& tracks);

}  // namespace megablock
