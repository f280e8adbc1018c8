// Computes the errors of a match, given the relative orientation of its two images (Cannelle 2013). The match filter
// (match_filter.h) judges a match by them.
//
// The rays are C_a + s v_a and C_b + t v_b. With D = C_b - C_a and c = v_a' v_b:
//
//     s = (D'v_a - c D'v_b) / (1 - c^2),  t = (c D'v_a - D'v_b) / (1 - c^2)     feet of the shortest distance
//     r_M = |D' (v_a x v_b)| / |v_a x v_b|
//     r_im = |D' (v_a x v_b)| / sqrt(g_a^2 / f_a^2 + g_b^2 / f_b^2)             g_a: derivative by v_a across v_a
//
// s and t are the distances to the feet of the shortest connection, r_M is its length. r_im is the reprojection
// residual to first order (Sampson): the length of the corrections in both images, in pixels. g_a is the derivative of
// the triple product by v_a, perpendicular to v_a. r_im exists wherever the rays do, even where they meet behind the
// cameras.
#pragma once

#include "geometry/intersection/triangulation.h"

namespace megablock {

struct MatchErrors {
  double reprojection_px = 0;                 // r_im, pixels
  double ray_distance_m = 0;                  // r_M, metres
  double distance_a_m = 0, distance_b_m = 0;  // d_1, d_2 along the rays, metres; negative: behind; at most 1e4
  double angle_rad = 0;                       // alpha, between the rays, radians
};

// The rays must be in one frame, with unit directions. `focal_*_px` turn angles into pixels.
MatchErrors match_errors(const Ray& a, const Ray& b, double focal_a_px, double focal_b_px);

}  // namespace megablock
