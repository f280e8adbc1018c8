// Finds the directions of the datum that the observations of a tile leave free, and gives minimal constraints for them.
//
// The directions that change no residual are the null space of the 7 x 7 matrix of similarity_information.h. To
// constrain two frames along these directions is a minimal constraint: it is zero at the optimum and shifts no adjusted
// observation.
#pragma once

#include <ceres/problem.h>

#include <vector>

#include "adjust/tile/ceres_problem.h"

namespace megablock {

struct DatumDefect {
  LocalFrame first, second;  // the constrained frames; the same one when the component has a single frame
  int dimension = 0;         // 0 to 7
  // Rows: the constrained combinations of the increments (dw, dC) of the first and of the second frame.
  Eigen::Matrix<double, 7, 12> constraints = Eigen::Matrix<double, 7, 12>::Zero();
};

// One entry per connected component of the tile's observations whose datum is not complete.
std::vector<DatumDefect> datum_defects(const TileProblem& problem, const TileState& state);

// Adds the minimal constraints to the Ceres problem, at the current values of the frames.
void constrain_datum(const std::vector<DatumDefect>& defects, CeresTile& tile);

}  // namespace megablock
