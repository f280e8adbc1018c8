// Simulates blocks with known truth from a set of options. `megablock simulate` and the tests of whole blocks use it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "io/simulate/scene/layout.h"
#include "io/simulate/scene/simulated_block.h"
#include "io/simulate/scene/simulation_options.h"

namespace megablock {

SimulatedBlock simulate_block(const SimulationOptions& options);

// The same block, but its tracks are passed to a function in batches, in the order of their indices. The memory holds
// one batch, the frames and the images.
inline constexpr std::int64_t kTrackBatch = 1 << 20;  // observations
SimulatedBlock simulate_block(const SimulationOptions& options, const TrackSink& sink,
                              std::int64_t batch_observations = kTrackBatch);

// The parts of it for other observations, such as rendered images. The options must have passed check().
Layout make_layout(const SimulationOptions& options);
// Simulates priors, given poses and relative poses: from a trajectory (Stereopolis), or with true sigmas (other
// scenes).
void simulate_given(const SimulationOptions& options, SimulatedBlock& simulated);

}  // namespace megablock
