// Rotation between two sets of directions, y = R x: least squares in closed form (Kabsch 1976) and a robust variant.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

namespace megablock {

// Minimises sum w |y - R x|^2; weights empty = all one. Directions all on one line leave the rotation about it
// arbitrary (but proper). Not a number where some of them is not.
Eigen::Quaterniond fit_rotation(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                std::span<const double> weights = {});

// By iterated reweighting with Geman-McClure weights 1 / (1 + (r / s)^2)^2, s three times the median residual: up to
// about a third of the pairs may be wrong.
Eigen::Quaterniond fit_rotation_robust(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to);

}  // namespace megablock
