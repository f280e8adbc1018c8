// How nearly points lie on one straight line.
#pragma once

#include <Eigen/Core>
#include <span>

namespace megablock {

// Standard deviation of the points across the line that fits them best, divided by that along it; 0 with fewer than
// three points or without extent.
double line_ratio(std::span<const Eigen::Vector3d> points);

}  // namespace megablock
