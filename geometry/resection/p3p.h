// Pose of a camera from three points (perspective three-point problem), up to four solutions.
//
// The three cosine laws are quadrics in the distances; two combinations without constant term are conics, whose pencil
// holds a pair of lines: a root of a cubic (Persson and Nordberg, "Lambda Twist: an accurate fast robust perspective
// three point (P3P) solver", ECCV 2018). The pair is taken apart by its adjugate (Richter-Gebert, "Perspectives on
// projective geometry", 2011, 11.1); each line meets the conics in two points at most. Newton iterations on the cosine
// laws polish the distances.
//
// Degenerate: points on one line. On the danger cylinder, which stands at right angles on the plane of the points over
// the circle through them, two solutions coincide (E. H. Thompson, "Space resection: failure cases", Photogrammetric
// Record 5(27), 1966): errors there grow as the root of those of the rays, and four exact samples in a thousand on it
// are missed; near it errors grow fast.
#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/numbers/solutions.h"
#include "geometry/transform/pose.h"

namespace megablock {

// `rays`: unit viewing directions in camera axes; `points`: in the ground frame, same order. Poses ground -> camera,
// all points in front. Empty for points on one line or where no camera sees them so.
Solutions<Pose, 4> solve_p3p(const std::array<Eigen::Vector3d, 3>& rays, const std::array<Eigen::Vector3d, 3>& points);

}  // namespace megablock
