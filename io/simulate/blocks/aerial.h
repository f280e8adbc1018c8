// Makes the layout of an aerial block.
#pragma once

#include "io/simulate/scene/layout.h"

namespace megablock {

Layout make_aerial_layout(const SimulationOptions& options);

}  // namespace megablock
