// Tests whether the residuals of a camera have structure over its sensor, that is, whether the lens distorts in a way
// that the camera model does not describe.
//
// The sensor is cut into C cells. Cell c has n_c residuals with the mean r_c. sigma^2 is the scatter about the cells'
// own means, pooled over all cells (2 (n - C) degrees of freedom); structure that is finer than a cell counts as
// scatter. Then
//
//     T = sum_c n_c |r_c|^2 / sigma^2
//
// is chi-square distributed with 2C - p degrees of freedom if only noise is left, because the adjustment has made the
// residuals orthogonal to the fields of the p parameters of the camera. Poses and points absorb a further part, which
// makes T smaller, so that the test rather calls a field clean. sigma is known from many residuals. With few residuals,
// T over its degrees of freedom is Fisher distributed, and the cells are made larger instead (kPerCell).
//
// The part of the mean square of a residual that is structure is (T - (2C - p)) sigma^2 / n; its root is
// `structure_px`.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/residual_field.h"

namespace megablock {

struct ResidualAtPixel {
  Eigen::Vector2d pixel;     // measured
  Eigen::Vector2d residual;  // adjusted minus measured, px
};

struct ResidualStructure {
  ResidualField field;
  std::int64_t residuals = 0;
  double statistic = 0, degrees = 0;  // T and 2C - p; degrees 0: too few residuals for a test
  double probability = 1;             // of an equal or larger T from noise alone
  double structure_px = 0;            // root mean square of the structure, length of the vectors; 0: none shows
};

// `parameters` is the number of camera parameters that were estimated from these residuals. width, height: of the
// sensor, px.
ResidualStructure residual_structure(const std::vector<ResidualAtPixel>& residuals, int width, int height,
                                     int parameters);

}  // namespace megablock
