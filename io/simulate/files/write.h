// Writes a simulated block without images: its tie points are given in a file.
//
// truth_tracks.h5 has the truth of tie_points.h5 row by row: the position of each track, and the Verdict of each
// observation. The job never reads it.
// Internal to io/: it is not installed.
#pragma once

#include <cstdint>
#include <string>

#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/project_text.h"

namespace megablock {

// Writes folder/block.yaml (with `tie_points: tie_points.h5` and `block: given.h5`), truth.csv, truth.h5 (poses and
// cameras), and truth_tracks.h5 (points, outliers). Tracks are written in batches while they are simulated.
void write_simulated_block(const SimulationOptions& options, const std::string& folder,
                           EditedProject edited = EditedProject::kRefuse,
                           std::int64_t batch_observations = kTrackBatch);
// Reads truth_tracks.h5: the positions of the points and the verdicts on the observations, without the tracks.
SimulatedTracks read_truth_tracks(const std::string& path);

}  // namespace megablock
