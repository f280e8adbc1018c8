// Rotation between two directions, and between two sets of them, y = R x: least squares in closed form (Kabsch 1976)
// and a robust variant.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

namespace megablock {

// The least rotation that turns `from` into `to`, sure to rounding / (1 + cosine of the angle between them); where they
// are opposite to 1e-6 rad, where Eigen's FromTwoVectors takes other axes, a half turn about any axis across them, sure
// to rounding.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Minimises sum w |y - R x|^2; weights empty = all one. Directions all on one line leave the rotation about it
// arbitrary (but proper). Not a number where some of them is not, or there are not equally many of each.
Eigen::Quaterniond fit_rotation(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                std::span<const double> weights = {});

// By iterated reweighting with Geman-McClure weights 1 / (1 + (r / s)^2)^2, s three times the median residual: up to
// about a third of the pairs may be wrong.
Eigen::Quaterniond fit_rotation_robust(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to);

}  // namespace megablock
