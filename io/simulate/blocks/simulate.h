// Simulated blocks with known truth: one options-driven generator behind all pipeline tests and `megablock simulate`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

SimulatedBlock simulate_block(const SimulationOptions& options);

// The same block, its tracks handed over in batches in the order of their indices. The memory is that of one batch and
// of the frames and images.
inline constexpr std::int64_t kTrackBatch = 1 << 20;  // observations
SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations = kTrackBatch);

}  // namespace megablock
