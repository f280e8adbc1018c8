// Gives the covariances of a free block in the datum of inner constraints, and in that of a comparison of positions.
// The S-transformation (Baarda 1973; Teunissen 1985, "Zero order design")
//
//     C' = S C S',   S = I - N M^-1 N'W,   M = N'WN over the component's frames,
//
// moves them from the minimal constraints of gauge.h to the constraints N'W x = 0: of all x that differ by a similarity
// it takes the one with the least x'W x over the frames. Since S N = 0, C' does not depend on the frames that the
// minimal constraints hold. Multiplied out, with Z = C W N and K = N'W C W N, the block of an unknown i is
//
//     C'_ii = C_ii - Z_i M^-1 N_i' - N_i M^-1 Z_i' + N_i M^-1 K M^-1 N_i'.
//
// Two weights are used.
//
//   * W = (1, 1, 1, 1/L^2, ...), with N of the free directions: inner constraints. They exist for every block.
//   * W_p = (0, 0, 0, 1/L^2, ...), with all seven columns of N: the best-fit similarity of the positions. An error
//   after
//     such a fit, x - N (N'W_p N)^-1 N'W_p x, is S x, and its covariance is C'. It does not exist where all positions
//     are on one line.
//
// Z comes from as many further right-hand sides W N in the sweeps over the tree as there are columns of N. Off the
// frames W is zero, but points and mounts have rows of Z and N, and they are transformed too. Intrinsics have no rows
// in N, so their covariances stay. M and K are small and are summed over the tiles.
//
// Z serves the constraints over all frames alone. Those over some of the frames need the covariances between frames,
// which a small block has (frame_covariance()).
#pragma once

#include <optional>

#include "merge/datum/gauge.h"

namespace megablock {

// The sums of the S-transformations over the frames that a tile owns. They are added in tile order. Each frame is owned
// by one tile of the block.
struct InnerSums {
  Eigen::MatrixXd m, k;  // [defect x defect]: N'WN, N'W C W N
  // [free components] N'W_p N, N'W_p C W_p N
  std::vector<Matrix77> position_m, position_k;
  void add(const InnerSums& other);
  Bytes to_bytes() const;
  static InnerSums from_bytes(const Bytes& bytes);
};
InnerSums inner_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                     const TileState& state, const Step& unknowns);

// Moves the covariances of a tile to inner constraints, in place: frames, points and mounts; and fills in
// TileCovariance::aligned_frames. The covariances of the separator (TileCovariance::boundary) stay under the minimal
// constraints. `sums` are those of the whole block. `unknowns` is the tile's step with the further columns (TileStep),
// the same that covariance_tile() got as `columns`. Does nothing where the datum is fixed.
void to_inner_constraints(const BlockGauge& gauge, const InnerSums& sums, std::int64_t tile, const TileProblem& problem,
                          const TilePlan& plan, const TileState& state, const Step& unknowns,
                          TileCovariance& covariance);

// The rows of the frames that a tile owns, of a step with unit_columns() and of N with the free directions.
struct FrameColumns {
  Step step{{}, 1, {}};
  std::vector<double> moves;    // [6 frames x defect], column-major
  std::vector<double> weights;  // [6 frames] W; 0: the frame has no free datum
  Bytes to_bytes() const;
  static FrameColumns from_bytes(const Bytes& bytes);
};
FrameColumns frame_columns(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                           const TileState& state, const Step& unknowns);
// The covariance of all `frames`, under inner constraints where the datum is free, from the rows of all tiles in tile
// order.
CovarianceMatrix frame_covariance(const BlockGauge& gauge, const UnknownList& frames,
                                  const std::vector<FrameColumns>& tiles);

}  // namespace megablock
