// Makes the layout of the block of a street-mapping vehicle.
#pragma once

#include "io/simulate/scene/layout.h"

namespace megablock {

Layout make_stereopolis_layout(const SimulationOptions& options);

}  // namespace megablock
