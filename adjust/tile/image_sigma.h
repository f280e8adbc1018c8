// The variance component of the image measurements of tie points.
//
// Sigmas of GNSS positions and control points are stated; that of a tie point measurement is a guess. One variance
// factor for all would spread the error of the guess over the stated ones, in the weights as in the posterior sigmas.
// So the sigma of the measurements is estimated from their own residuals, as in variance component estimation (Helmert
// 1907, Förstner 1979): weighted squares over redundancy, repeated until it does not change, with the residuals that
// the screening at this sigma would leave. The redundancy of the group is taken as
//   2 observations - 3 points - unknowns of frames, cameras and mounts,
// as if the priors had no part in the unknowns; what that neglects is unknowns / redundancy, below 1 % in a usual
// block.
#pragma once

#include <cstdint>
#include <optional>

#include "adjust/tile/tile_adjustment.h"

namespace megablock {

// Of the kept measurements of tie points within the screening threshold at the problem's sigma.
struct ImageResiduals {
  double weighted_squares = 0;  // px^2, by the weights of the robust loss
  std::int64_t observations = 0, points = 0;
  void add(const ImageResiduals& other);
};
ImageResiduals image_residuals(const TileProblem& problem, const TileState& state, const AdjustOptions& options);

// Sigma per axis, px. `unknowns`: of frames, cameras and mounts. Empty when there is too little redundancy to tell.
std::optional<double> image_sigma(const ImageResiduals& residuals, std::int64_t unknowns);

// Gives the measurements of tie points (not of control and check points) this sigma.
void set_image_sigma(TileProblem& problem, double sigma_px);

// The tile's own estimate, adopted in the problem. Without effect when it cannot be told.
void estimate_image_sigma(TileProblem& problem, const TileState& state, const AdjustOptions& options);

}  // namespace megablock
