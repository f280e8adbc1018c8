// Finds rotations that turn one direction, or one set of directions, into another.
//
// fit_rotation() minimises sum w |y - R x|^2 in closed form: with the singular value decomposition sum w y x' = U S V',
// the best rotation is R = U diag(1, 1, det(U V')) V' (W. Kabsch, Acta Crystallographica A32, 1976).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>

namespace megablock {

// Returns the rotation by the smallest angle that turns `from` into `to`; the vectors need not be unit vectors. Its
// error is rounding / (1 + cosine of the angle between them). For vectors opposite to within 1e-6 rad the axis is
// undetermined; the function then returns a half turn about an axis perpendicular to them, accurate to rounding.
// (Eigen's FromTwoVectors chooses another axis there.)
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Least squares over pairs (x, y); empty `weights` means equal weights. If all directions lie on one line, the rotation
// about it is arbitrary, but the result is a rotation. Returns a quaternion of NaN for lists of different length and
// for input that is not finite.
Eigen::Quaterniond fit_rotation(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                                std::span<const double> weights = {});

// The same with outliers among the pairs: iterated reweighting with Geman-McClure weights 1 / (1 + (r / s)^2)^2, where
// r is the residual |y - R x| and s three times its median. It tolerates outliers up to about a third of the pairs.
// `from` and `to` must be unit vectors of equal number.
Eigen::Quaterniond fit_rotation_robust(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to);

}  // namespace megablock
