// Reads the tie points that are given with a job, checks them against the block, and gives them to the tiles that own
// them.
#pragma once

#include <functional>
#include <string>

#include "io/block/block.h"
#include "io/block/image_graph.h"
#include "io/block/tracks.h"

namespace megablock {

// Throws InputError when a track names an image that the block does not have.
void check_images(const std::string& tie_points, const TrackSet& tracks, const Block& block);
// Reads the whole file and checks it in the same way.
TrackSet read_given_tracks(const std::string& tie_points, const Block& block);

// Calls `take` with the tracks of tile 0, 1, ... in turn, and `after_batch` after every batch of the file. The file is
// read once. Observations beyond `observations_at_a_time` (24 bytes each) wait in the scratch file, which is made when
// it is needed and removed afterwards. The result does not depend on this number. Errors are those of check_images();
// throws StoreError when the scratch file cannot be written.
void deal_given_tracks(const std::string& tie_points, const Block& block, const Tiles& tiles,
                       const std::string& scratch_file, const std::function<void(const TrackSet&)>& take,
                       const std::function<void()>& after_batch = {},
                       std::int64_t observations_at_a_time = std::int64_t{1} << 20);

}  // namespace megablock
