// Makes the layouts of the scenes whose four sides look alike: a courtyard seen from inside, and a tower seen from
// outside. Their images are rendered only (images/city.h).
//
// The court and the plan of the tower are squares about the origin of the ground frame. Cameras stand on a ring about
// the origin, 1.6 m above the ground, with places and directions that vary a little. No image matches another one
// exactly, but after a quarter of a turn an image shows almost the same again.
#pragma once

#include "io/simulate/scene/layout.h"

namespace megablock {

inline constexpr double kCourtSide = 24, kTowerSide = 14;  // metres, from facade to facade

Layout make_courtyard_layout(const SimulationOptions& options);
Layout make_tower_layout(const SimulationOptions& options);

}  // namespace megablock
