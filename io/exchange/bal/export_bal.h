// BAL problems and Bundler files; the conversion is in io/exchange/bal/bal_camera.h. Only oriented images, known points
// and kept observations are written; every image has a camera of its own there.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// "cameras points observations", observations "camera point x y" by point, then per camera the nine numbers rotation
// vector, t, f, k1, k2, one a line, then the points.
void export_bal(const BlockResult& result, const std::string& path);

// Bundle file v0.3, and the images' names in <path>.list.txt ("name 0 focal_px").
void export_bundler(const BlockResult& result, const std::string& path);

}  // namespace megablock
