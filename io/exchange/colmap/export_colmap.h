// COLMAP sparse models, text and binary: a folder with cameras, images, points3D (.txt or .bin).
//
// Conventions agree with ours: rotation world -> camera, t = -R C, looking along +z, y down, pixel centres at +0.5. The
// world is the block's local frame. Camera model OPENCV (fx fy cx cy k1 k2 p1 p2), FULL_OPENCV with k3 (k4..k6 = 0)
// when k3 is not zero; both are our model exactly. Ids are the block's indices + 1. Images of rigs are written as
// single cameras. Points carry no colour (grey) and, as error, the mean length of their residuals in pixels.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

void export_colmap_text(const BlockResult& result, const std::string& folder);
void export_colmap_binary(const BlockResult& result, const std::string& folder);

}  // namespace megablock
