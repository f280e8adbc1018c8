// Imports models of other programs, as a block with given poses, tie points and their positions.
#pragma once

#include <string>
#include <vector>

#include "io/exchange/model/imported_block.h"

namespace megablock {

// The formats: "colmap-text" and "colmap-bin" (a folder), "bal" and "bundler" (one file each; <path>.list.txt gives the
// names of the images if it exists).
const std::vector<std::string>& import_formats();

// Reads a model. Throws InputError for an unknown format, and with file:line (for binary files: the byte) for malformed
// files and indices out of range.
//
// BAL and Bundler files have neither image sizes nor principal points. The image is taken as the smallest one that
// contains all observations of the camera, with its centre as the principal point; principal point, k3, p1, p2 are
// held. The COLMAP cameras that the table of camera models names are read (kColmap in geometry/camera/models/), of
// FULL_OPENCV those with k4 to k6 = 0; fx and fy must agree to 1e-9. Observations without a point are left out.
ImportedBlock import_block(const std::string& format, const std::string& path);

// Writes a project that `megablock run` reads: folder/block.yaml, given.h5, tie_points.h5.
void write_imported(const ImportedBlock& imported, const std::string& folder);

}  // namespace megablock
