// Estimates the variance component of the tie point observations.
//
// Sigmas of GNSS positions and control points are stated; that of a tie point observation is a guess. One variance
// factor for all observations would spread the error of the guess over the stated sigmas, in the weights and in the
// posterior sigmas. The sigma of the observations is therefore estimated from their own residuals, as in variance
// component estimation (Helmert 1907, Förstner 1979). It is weighted squares over redundancy, repeated until it does
// not change, with the residuals that the screening at this sigma would leave. The redundancy of the group is taken as
//
//   2 observations - 3 points - unknowns of frames, cameras and mounts,
//
// as if the priors did not contribute to the unknowns. The error of this simplification is unknowns / redundancy, below
// 1 % in a usual block.
#pragma once

#include <cstdint>
#include <optional>

#include "adjust/tile/tile_adjustment.h"

namespace megablock {

// Sums over the kept tie point observations within the screening threshold at the problem's sigma.
struct ImageResiduals {
  double weighted_squares = 0;  // px^2, with the weights of the robust loss
  std::int64_t observations = 0, points = 0;
  void add(const ImageResiduals& other);
};
ImageResiduals image_residuals(const TileProblem& problem, const TileState& state, const AdjustOptions& options);

// The sigma per axis, px. `unknowns` is the number of those of frames, cameras and mounts. Empty when the redundancy is
// too small.
std::optional<double> image_sigma(const ImageResiduals& residuals, std::int64_t unknowns);

// Sets the sigma of the tie point observations (not those of control and check points).
void set_image_sigma(TileProblem& problem, double sigma_px);

// Sets the sigma of the problem to the tile's own estimate. Without an estimate the sigma stays.
void estimate_image_sigma(TileProblem& problem, const TileState& state, const AdjustOptions& options);

}  // namespace megablock
