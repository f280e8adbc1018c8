// Finds the similarity of a model to control of which some points have only a height and others only a planimetric
// position. There are seven equations for seven unknowns. A full control point counts as both. Kalantari (2009, chapter
// 9) counts the equations; the solutions are derived here. Two mixes are minimal, and each has up to two solutions.
//
// Two planimetric points and three heights (for example two full points and one height). With Y = s R X + t, let
// u = s r_3 be the scaled third row of R. Differences of heights give u . (X_i - X_1) = Z_i - Z_1, so u = u_0 + k n
// with the normal n of the three points and an unknown k. The two planimetric points are a vector d apart in the model
// and a horizontal distance D on the ground. Then s^2 |d|^2 = D^2 + (u.d)^2 and s = |u|, hence
//
//     |(u_0 + k n) x d|^2 = D^2,
//
// a quadratic in k. The other two rows of R turn d onto its direction on the ground. Degenerate cases: the points with
// heights on one line; d along their normal.
//
// Three planimetric points and one height. The scaled rows are p = s r_1 = p_0 + a n and q = s r_2 = q_0 + b n in the
// same way. They must be perpendicular and of equal length, p.q = 0 and |p| = |q|, which is one complex equation,
// (a + ib)^2 = |q_0|^2 - |p_0|^2 - 2i p_0.q_0. Its two roots are mirror images in the plane of the points; a fourth
// point tells them apart. Degenerate case: the three points on one line.
//
// Heights do not determine the heading: one planimetric point with any number of heights gives no similarity.
#pragma once

#include <array>

#include "geometry/numbers/solutions.h"
#include "geometry/similarity/similarity.h"

namespace megablock {

// Control in X and Y only.
struct PlaceControl {
  Eigen::Vector3d model;
  Eigen::Vector2d ground;  // X, Y
};
// Control in Z only.
struct HeightControl {
  Eigen::Vector3d model;
  double ground = 0;  // Z
};

// Return the similarities model -> ground. Empty for degenerate control, where the heights contradict the planimetric
// points under every rotation, and for input that is not finite.
Solutions<Similarity, 2> solve_minimal_control(const std::array<PlaceControl, 2>& places,
                                               const std::array<HeightControl, 3>& heights);
Solutions<Similarity, 2> solve_minimal_control(const std::array<PlaceControl, 3>& places, const HeightControl& height);

}  // namespace megablock
