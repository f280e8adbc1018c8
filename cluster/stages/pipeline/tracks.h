// The stage of tracks: tracks/<tile>.h5, the tie points that each tile owns.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "io/block/image_graph.h"

namespace megablock {

// Tracks by owner tile: tracks/<tile>.h5 (ids: first image x 2^24 + feature, stable when a block grows; dense indices
// are given in the result). Returns the unit names by tile.
std::vector<std::string> run_tracks(Job& job, const std::vector<std::string>& matches, const Tiles& tiles);
std::vector<std::string> run_given_tracks(Job& job, const std::string& tie_points, const Tiles& tiles);

// Collective. Brings the index of the measurement store (io/result/measurements.h) up to date with the tracks.
void index_measurements(Job& job, const std::vector<std::string>& tracks);

}  // namespace megablock
