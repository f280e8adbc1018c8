// A job's result as one tile: poses, points and kept observations as adjusted, with the sigmas that they were adjusted
// with.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "io/result/result.h"

namespace megablock {

struct ResultTile {
  TileProblem problem;
  TileState state;
};
// `result` with its tracks. Measured control points are taken as kept where the residual is finite and at most 4
// sigmas.
ResultTile tile_of_result(const BlockResult& result, const ObservationOptions& options);

}  // namespace megablock
