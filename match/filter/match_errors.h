// What the relative orientation of two images says of a match (CN-14).
//
// Rays C_a + s v_a and C_b + t v_b, D = C_b - C_a, c = v_a' v_b:
//
//     s = (D'v_a - c D'v_b) / (1 - c^2),  t = (c D'v_a - D'v_b) / (1 - c^2)     feet of the shortest distance
//     r_M = |D' (v_a x v_b)| / |v_a x v_b|
//     r_im = |D' (v_a x v_b)| / sqrt(g_a^2 / f_a^2 + g_b^2 / f_b^2)             g_a: derivative by v_a across v_a
//
// r_im is the reprojection residual to first order, the length of both images' corrections in pixels (Sampson); it
// exists wherever the rays do, also when they meet behind the cameras.
#pragma once

#include "geometry/intersection/triangulation.h"

namespace megablock {

struct MatchErrors {
  double reprojection_px = 0;                 // r_im
  double ray_distance_m = 0;                  // r_M
  double distance_a_m = 0, distance_b_m = 0;  // d_1, d_2 along the rays; negative: behind. At most 1e4
  double angle_rad = 0;                       // alpha, between the rays
};

MatchErrors match_errors(const Ray& a, const Ray& b, double focal_a_px, double focal_b_px);

}  // namespace megablock
