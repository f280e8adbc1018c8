// Simulates tie points and their observations.
#pragma once

#include <cstddef>
#include <cstdint>

#include "io/simulate/blocks/observe.h"

namespace megablock {

// Passes the tracks to `sink` in batches of about `batch_observations`, in the order of their indices.
void simulate_tracks(const SimulationOptions& options, const Layout& layout, const Observer& observer,
                     const TrackSink& sink, std::int64_t batch_observations);
// Appends the tracks [first, last) of `from`.
void append_tracks(SimulatedTracks& to, const SimulatedTracks& from, std::size_t first, std::size_t last);

}  // namespace megablock
