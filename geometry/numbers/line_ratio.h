// Measures how close points are to one straight line. Points on a line leave a rotation about it undetermined, so
// callers test for this before they trust a fit.
#pragma once

#include <Eigen/Core>
#include <span>

namespace megablock {

// Returns the ratio of two standard deviations of the points: across the line that fits them best (in the wider of the
// two directions across it), and along that line. It is 0 for points on a line and 1 for points that extend equally in
// two directions. Returns 0 for fewer than three points and for points that coincide.
double line_ratio(std::span<const Eigen::Vector3d> points);

}  // namespace megablock
