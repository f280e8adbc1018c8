// Pose of a camera from three points (perspective three-point problem), up to four solutions.
//
// Grunert's quartic in the ratio of two distances, with the coefficients as in Haralick, Lee, Ottenberg and Noelle,
// "Review and analysis of solutions of the three point perspective pose estimation problem", IJCV 13(3), 1994; the
// distances are polished by Newton iterations on the three cosine laws.
//
// Degenerate: points on one line. On the danger cylinder, which stands at right angles on the plane of the points over
// the circle through them, two solutions coincide (E. H. Thompson, "Space resection: failure cases", Photogrammetric
// Record 5(27), 1966): errors there grow as the root of those of the rays, and three exact samples in a hundred on it
// are missed; near it errors grow fast.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/pose.h"
#include "geometry/solutions.h"

namespace megablock {

// `rays`: unit viewing directions in camera axes; `points`: in the ground frame, same order. Poses ground -> camera,
// all points in front. Empty for points on one line or where the quartic has no valid root.
Solutions<Pose, 4> solve_p3p(const std::array<Eigen::Vector3d, 3>& rays, const std::array<Eigen::Vector3d, 3>& points);

}  // namespace megablock
