// Gives the result of a job as one tile: its poses, points and kept observations, with the sigmas of the adjustment.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "io/result/result.h"

namespace megablock {

struct ResultTile {
  TileProblem problem;
  TileState state;
};
// `result` comes with its tracks. Measured control points count as kept where the residual is finite and at most 4
// sigmas.
ResultTile tile_of_result(const BlockResult& result, const ObservationOptions& options);

}  // namespace megablock
