// Places that stand on one straight line, as the cameras of a strip do: rms width across the line below 0.03 of the rms
// length along it.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace megablock {

// `scatter`: sum of (C - mean)(C - mean)' over the places. Unit direction of their line; empty where they have none.
std::optional<Eigen::Vector3d> straight_line(const Eigen::Matrix3d& scatter);

}  // namespace megablock
