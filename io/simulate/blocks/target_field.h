// Makes the layout of the target field of a vehicle.
#pragma once

#include "io/simulate/scene/layout.h"

namespace megablock {

Layout make_target_field_layout(const SimulationOptions& options);

}  // namespace megablock
