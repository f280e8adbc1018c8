// A simulated block in files, at the level of tie points.
#pragma once

#include <cstdint>
#include <string>

#include "io/simulate/blocks/simulate.h"
#include "io/simulate/files/project_text.h"

namespace megablock {

// The tie-point level, streamed to the files: folder/block.yaml (with `tie_points: tie_points.h5`, `block: given.h5`),
// truth.csv, truth.h5 (poses, cameras), truth_tracks.h5 (points, wrong observations).
void write_simulated_block(const SimulationOptions& options, const std::string& folder,
                           EditedProject edited = EditedProject::kRefuse,
                           std::int64_t batch_observations = kTrackBatch);
// Of truth_tracks.h5: positions of the points and verdicts on the observations, no tracks.
SimulatedTracks read_truth_tracks(const std::string& path);

}  // namespace megablock
