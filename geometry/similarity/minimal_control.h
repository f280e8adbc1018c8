// Similarity of a model to control of which some points have only a height or only a place (Kalantari 2009, M54, which
// counts the equations; the solutions are derived here): seven equations for seven unknowns. Full points count as both.
// The minimal mixes that determine a similarity are two; each has up to two solutions.
//
// Two places and three heights (two full points and a height among them). With Y = s R X + t let u = s r_3 be the
// scaled third row of R. Height differences give u . (X_i - X_1) = Z_i - Z_1, so that u = u_0 + k n along the normal n
// of the three points. Between the two places, d apart in the model and D in the ground, s^2 |d|^2 = D^2 + (u.d)^2 with
// s = |u|:
//
//     |(u_0 + k n) x d|^2 = D^2,
//
// a quadratic in k. The other two rows turn d onto the direction in the ground. Degenerate: the points with heights on
// one line, or d along their normal.
//
// Three places and one height. The scaled first rows p = s r_1, q = s r_2 are p_0 + a n, q_0 + b n likewise; p.q = 0
// and |p| = |q| are the complex square  (a + ib)^2 = |q_0|^2 - |p_0|^2 - 2i p_0.q_0:  two solutions, mirror images in
// the plane of the points, that a fourth point tells apart. Degenerate: the three on one line.
//
// Heights say nothing about the heading, so that one place and any number of heights do not determine a similarity.
#pragma once

#include <array>

#include "geometry/numbers/solutions.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

struct PlaceControl {
  Eigen::Vector3d model;
  Eigen::Vector2d ground;  // X, Y
};
struct HeightControl {
  Eigen::Vector3d model;
  double ground = 0;  // Z
};

// Model -> ground. Empty for degenerate control, for heights that no rotation reconciles with the places, and where
// something is not a number.
Solutions<Similarity, 2> solve_minimal_control(const std::array<PlaceControl, 2>& places,
                                               const std::array<HeightControl, 3>& heights);
Solutions<Similarity, 2> solve_minimal_control(const std::array<PlaceControl, 3>& places, const HeightControl& height);

}  // namespace megablock
