// Holds the common result of all importers: the block that a reader of a foreign format returns.
#pragma once

#include <vector>

#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

struct ImportedBlock {
  Block block;                          // every frame has a given pose; not georeferenced
  BlockState state;                     // poses, cameras
  TrackSet tracks;                      // observations rounded to 2^-10 px
  std::vector<Eigen::Vector3d> points;  // [tracks]
};

}  // namespace megablock
