// Finds the control points that contradict the shape which the images alone give a tile.
//
// A gross error of a control point bends a small block, until its good control points seem wrong too. Of five points
// one at a corner determines its own surroundings by more than a half, and a loss that pulls from any distance then
// follows it, however far it is off. The shape of a tile that was adjusted without its control cannot be bent. A robust
// similarity of this shape onto the control (control_alignment.h) does not notice one wrong point of five.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "adjust/checks/prior_test.h"
#include "adjust/problem/tile_problem.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

inline constexpr std::int64_t kFewestControl = 5;  // points, of which one may be wrong

struct ControlCheck {
  Similarity to_control;       // tile -> ground
  std::vector<PriorId> wrong;  // ascending; at most a fifth of the points
};

// The control points of the tile that can be tested: those that are not held. They must be set aside while the tile is
// adjusted for check_control().
std::vector<PriorId> testable_control(const TileProblem& problem);

// `state`: the tile as adjusted without its control; `oriented`: the state of the block from which it was made. A point
// is wrong that is much farther off than others, and than its stated sigmas explain. Points of other tiles help to find
// the similarity, but are not judged: this tile sees them in images at its edge, which few tie points hold. Empty where
// nothing can be said: with fewer than five points, where images of the points do not hang together, and where more
// than a fifth of the points are wrong.
std::optional<ControlCheck> check_control(const Block& block, const BlockState& oriented, const TileProblem& problem,
                                          const TileState& state);

}  // namespace megablock
