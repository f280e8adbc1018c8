// Imports of other programs' models as a block with given poses, tie points and their positions.
#pragma once

#include <string>
#include <vector>

#include "io/exchange/model/imported_block.h"

namespace megablock {

// The formats: "colmap-text" and "colmap-bin" (a folder), "bal" and "bundler" (one file each; image names from
// <path>.list.txt when it is there).
const std::vector<std::string>& import_formats();

// InputError with file:line (binary files: the byte) for malformed files and indices out of range, InputError for an
// unknown format.
//
// BAL and Bundler keep neither image sizes nor principal points: the image is taken as the smallest one, with its
// centre as principal point, that holds all observations of the camera; principal point, k3, p1, p2 are held. COLMAP
// cameras SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV (k4..k6 = 0) are read; fx and fy must
// agree to 1e-9. Observations without a point are left out.
ImportedBlock import_block(const std::string& format, const std::string& path);

// Makes a project of it that `megablock run` reads: folder/block.yaml, given.h5, tie_points.h5.
void write_imported(const ImportedBlock& imported, const std::string& folder);

}  // namespace megablock
