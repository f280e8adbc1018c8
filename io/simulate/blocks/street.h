// Makes the layout of a street block.
#pragma once

#include "io/simulate/scene/layout.h"

namespace megablock {

Layout make_street_layout(const SimulationOptions& options);

}  // namespace megablock
