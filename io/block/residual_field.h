// Residuals of image measurements binned over the sensor of a camera: what a systematic field, and the coverage of the
// sensor by measurements, are seen from.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct ResidualField {
  int columns = 0, rows = 0;
  std::vector<Eigen::Vector2d> sum;  // [rows x columns] adjusted minus measured, px
  std::vector<std::int64_t> count;
  double squares = 0;  // of the lengths, px^2
  std::int64_t observations = 0;

  ResidualField() = default;
  // Square cells, `cells` along the longer side.
  explicit ResidualField(const Camera& camera, int cells = 24);
  // `pixel`: where it was measured; beyond the border it belongs to the nearest cell.
  void add(const Camera& camera, const Eigen::Vector2d& pixel, const Eigen::Vector2d& residual);
  Eigen::Vector2d mean(int row, int column) const;
};

}  // namespace megablock
