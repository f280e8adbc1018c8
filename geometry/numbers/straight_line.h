// Says whether points lie on one straight line, as the projection centres of a strip do: their rms width across the
// line is below 0.03 of their rms length along it. The rotation of a block about such a line is not determined by
// positions.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace megablock {

// Returns the unit direction of the line, or nothing if the points do not lie on one. `scatter` is the sum of
// (C - mean)(C - mean)' over the points C.
std::optional<Eigen::Vector3d> straight_line(const Eigen::Matrix3d& scatter);

}  // namespace megablock
