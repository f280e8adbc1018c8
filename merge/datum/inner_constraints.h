// Gives the covariances of a free block under inner constraints. The S-transformation (Baarda 1973)
//
//     C' = S C S',   S = I - N M^-1 N'W,   M = N'WN over the component's frames,  W = (1, 1, 1, 1/L^2, ...)
//
// moves them from the minimal constraints of gauge.h to inner constraints N'W x = 0: of all x that differ by a
// similarity it takes the one with the least x'W x over the frames. Since S N = 0, C' does not depend on the frames
// that the minimal constraints hold. Multiplied out, with Z = C W N and K = N'W C W N, the block of an unknown i is
//
//     C'_ii = C_ii - Z_i M^-1 N_i' - N_i M^-1 Z_i' + N_i M^-1 K M^-1 N_i'.
//
// Z comes from as many further right-hand sides W N in the sweeps over the tree as the datum has free directions. Off
// the frames W is zero, but points and mounts have rows of Z and N, and they are transformed too. Intrinsics have no
// rows in N, so their covariances stay. M and K are small and are summed over the tiles.
#pragma once

#include "merge/datum/gauge.h"

namespace megablock {

// The sums of the S-transformation over the frames that a tile owns. They are added in tile order. Each frame is owned
// by one tile of the block.
struct InnerSums {
  Eigen::MatrixXd m, k;  // [defect x defect]: N'WN, N'W C W N
  void add(const InnerSums& other);
  Bytes to_bytes() const;
  static InnerSums from_bytes(const Bytes& bytes);
};
InnerSums inner_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, const Step& unknowns);

// Moves the covariances of a tile to inner constraints, in place: frames, points and mounts. Those of the separator
// (TileCovariance::boundary) stay under the minimal constraints. `sums` are those of the whole block. `unknowns` is the
// tile's step with the further columns (TileStep), the same that covariance_tile() got as `columns`. Does nothing where
// the datum is fixed.
void to_inner_constraints(const BlockGauge& gauge, const InnerSums& sums, std::int64_t tile, const TileProblem& problem,
                          const TilePlan& plan, const TileState& state, const Step& unknowns,
                          TileCovariance& covariance);

}  // namespace megablock
