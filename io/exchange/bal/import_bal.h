// Reads BAL and Bundler files (conventions: io/exchange/bal/bal_camera.h). Internal to io/.
//
// A BAL file is a sequence of numbers: cameras, points, observations; per observation camera, point, x, y; per camera
// the rotation vector, t, f, k1, k2; per point x, y, z. A Bundler file has the cameras first, with R as nine numbers
// row by row, and each point with its colour and its list of views (camera, key, x, y).
#pragma once

#include <string>
#include <vector>

#include "io/exchange/bal/bal_camera.h"
#include "io/exchange/model/imported_block.h"

namespace megablock {

struct BalObservation {
  std::int64_t camera = 0, point = 0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // relative to the principal point, y up
};

struct BalProblem {
  std::vector<BalCamera> cameras;
  std::vector<Eigen::Vector3d> points;
  std::vector<BalObservation> observations;
};

// Throws InputError with file:line for malformed numbers and indices out of range.
BalProblem read_bal(const std::string& path);

// Makes one camera, rig, frame and image of each BAL camera. Without names, images are called image000000, ...
ImportedBlock block_from_bal(const BalProblem& problem, const std::vector<std::string>& names);

ImportedBlock import_bal(const std::string& path);
ImportedBlock import_bundler(const std::string& path);

}  // namespace megablock
