// Readers of BAL and Bundler files (io/exchange/bal/bal_camera.h has the conventions). Internal to io/.
#pragma once

#include <string>
#include <vector>

#include "io/exchange/bal/bal_camera.h"
#include "io/exchange/model/imported_block.h"

namespace megablock {

struct BalObservation {
  std::int64_t camera = 0, point = 0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // y up, about the principal point
};

struct BalProblem {
  std::vector<BalCamera> cameras;
  std::vector<Eigen::Vector3d> points;
  std::vector<BalObservation> observations;
};

BalProblem read_bal(const std::string& path);

// One camera, rig, frame and image per BAL camera; names as given or image000000 ...
ImportedBlock block_from_bal(const BalProblem& problem, const std::vector<std::string>& names);

ImportedBlock import_bal(const std::string& path);
ImportedBlock import_bundler(const std::string& path);

}  // namespace megablock
