// Gives the cameras of the published simulations of a camera that turns about a point (Cannelle 2013, 2.3.3).
#pragma once

#include <vector>

#include "geometry/camera/intrinsics.h"

namespace megablock {

// The simulated cameras of the thesis, all of the model ign-radial. The table of the thesis prints b of the third
// camera with a minus sign, and sy of the fourth as 3709. Neither agrees with the edge corrections in the same table,
// so both are corrected here.
struct PublishedCamera {
  const char* name;
  int width, height;  // px
  Intrinsics truth;
  double edge_px;  // published edge correction
};
const std::vector<PublishedCamera>& published_cameras();

}  // namespace megablock
