// Colours the four sides of a courtyard or a tower: one facade, which every side shows again with details of its own.
//
// The facade has storeys with windows, a plinth and traces of weather. A share `own` of the windows looks different on
// each side, the traces of weather are a mixture of common and own ones in the same share, and each side has a door
// and stains at places of its own, whose contrast is this share.
// Internal to io/: it is not installed.
#pragma once

#include "io/simulate/images/texture.h"

namespace megablock {

struct FacadeSpot {
  double along = 0, up = 0;  // metres from the middle of the facade, to the right as one sees it, and from the ground
  int side = 0;              // 0 to 3
  double footprint_m = 0;    // size of the pixel on the facade
};

// The side whose wall has this outward normal, and how far to the right of its middle a point lies.
int facade_side(const Eigen::Vector3d& normal);
double along_facade(const Eigen::Vector3d& normal, const Eigen::Vector3d& point);

// Red, green, blue, 0 to 255, before light and shadow.
Eigen::Vector3f same_facade_colour(const Texture& texture, const FacadeSpot& spot, double own);

}  // namespace megablock
