// Collects the residuals of image observations in cells over the sensor of a camera. They show systematic errors of the
// camera model, and the parts of the sensor that have observations.
//
// Random errors cancel in the mean of a cell: with n observations of sigma s it has the sigma s / sqrt(n). What remains
// is systematic.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct ResidualField {
  int columns = 0, rows = 0;
  std::vector<Eigen::Vector2d> sum;  // [rows x columns] sums of adjusted minus measured, pixels
  std::vector<std::int64_t> count;
  double squares = 0;  // sum of squared lengths, px^2
  std::int64_t observations = 0;

  ResidualField() = default;
  // Square cells, `cells` of them along the longer side.
  explicit ResidualField(const Camera& camera, int cells = 24);
  // `pixel` is the measured position; beyond the border it counts in the nearest cell.
  void add(const Camera& camera, const Eigen::Vector2d& pixel, const Eigen::Vector2d& residual);
  Eigen::Vector2d mean(int row, int column) const;
};

}  // namespace megablock
