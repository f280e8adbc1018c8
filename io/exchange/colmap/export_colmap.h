// Writes COLMAP sparse models in text or binary form: a folder with the files cameras, images, points3D (.txt or .bin).
//
// COLMAP has our conventions: the rotation is world -> camera, t = -R C, the camera looks along +z with y down, and
// pixel centres are at +0.5. The world is the ground frame of the block. Brown cameras are written as OPENCV (fx fy cx
// cy k1 k2 p1 p2) with fx = f + b1 and fy = f, or as FULL_OPENCV with k4 to k6 = 0 if k3 is not zero; both are exactly
// our model without the skew b2. Observations of a camera with a skew are written as a camera without it would have
// measured them, so their rays stay the same, but the images have the skew still (export_note in io/exchange/export.h).
// Ids are the indices of the block + 1. Images of rigs are written as single cameras. Points are grey, and their error
// is the mean length of their residuals in pixels. Internal to io/: it is not installed.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// The folder must exist. Throw InputError if a file cannot be written, or a camera has a model that COLMAP lacks.
void export_colmap_text(const BlockResult& result, const std::string& folder);
void export_colmap_binary(const BlockResult& result, const std::string& folder);

}  // namespace megablock
