// Gives the covariances of a free block under inner constraints. The S-transformation (Baarda 1973)
//
//     C' = C S C',   S = I - N M^-1 N'W,   M = N'WN over the component's frames,  W = (1, 1, 1, 1/L^2, ...)
//
// moves them from the minimal constraints of gauge.h to inner constraints. C W N comes from as many further right-hand
// sides in the sweeps over the tree as the datum has free directions.
#pragma once

#include "merge/datum/gauge.h"

namespace megablock {

// The sums of the S-transformation over the frames that a tile owns. They are added in tile order.
struct InnerSums {
  Eigen::MatrixXd m, k;  // [defect x defect]: N'WN, N'W C W N
  void add(const InnerSums& other);
  Bytes to_bytes() const;
  static InnerSums from_bytes(const Bytes& bytes);
};
InnerSums inner_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, const Step& unknowns);

// Moves the covariances of a tile to inner constraints. `unknowns` is the tile's step with the further columns
// (TileStep), the same that covariance_tile() got as `columns`.
void to_inner_constraints(const BlockGauge& gauge, const InnerSums& sums, std::int64_t tile, const TileProblem& problem,
                          const TilePlan& plan, const TileState& state, const Step& unknowns,
                          TileCovariance& covariance);

}  // namespace megablock
