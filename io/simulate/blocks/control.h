// Simulates control and check points, either spread over the block or in zones on pedestrian crossings. They are added
// to layout.block and layout.control_truth, with their measurements in the images. Internal to io/: it is not
// installed.
#pragma once

#include "io/simulate/blocks/observe.h"

namespace megablock {

void simulate_control(const SimulationOptions& options, const Observer& observer, Layout& layout);
void simulate_control_zones(const SimulationOptions& options, const Observer& observer, Layout& layout);

}  // namespace megablock
