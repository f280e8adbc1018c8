// Writes BAL problems and Bundler files (conventions: io/exchange/bal/bal_camera.h). Only oriented images, points with
// a position and kept observations are written. In these formats every image has its own camera.
//
// Throw InputError if a file cannot be written, and for fisheyes and panoramas (check_bal_model).
// Internal to io/: it is not installed.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// The file has a line "cameras points observations", then a line "camera point x y" per observation, ordered by point,
// then for each camera nine numbers (rotation vector, t, f, k1, k2), one per line, then the points.
void export_bal(const BlockResult& result, const std::string& path);

// A Bundle file v0.3, and the names of the images in <path>.list.txt ("name 0 focal_px").
void export_bundler(const BlockResult& result, const std::string& path);

}  // namespace megablock
