// Gives the Sampson residual of a match for a relative orientation, with its derivatives (P. D. Sampson, "Fitting conic
// sections to 'very scattered' data", CGIP 18, 1982). It needs no object point, so an adjustment has only five
// unknowns.
//
//     E = [t]x R,  n = x_b' E x_a,  d = |(E x_a)_{1,2}|^2 + |(E' x_b)_{1,2}|^2,  r = n / sqrt(d)   (Sampson)
//
// for normalised image points x = (X/Z, Y/Z, 1). To first order r is the distance of the match from the nearest one
// that satisfies the coplanarity equation n = 0; its standard deviation is that of an image coordinate. The unknowns
// are the increment w of the rotation, R Exp(w) (rotation.h), and the base t on the unit sphere, along two axes p
// across it. With u = R x_a, the epipolar lines l_b = E x_a and l_a = E' x_b, and l' a line with its third element set
// to zero,
//
//     dn/dw = x_a x l_a,        (dd/dw)/2 = x_a x E' l_b' + l_a' x l_a,
//     dn/dp = p . (u x x_b),    (dd/dp)/2 = p . (u x l_b' - x_b x R l_a').
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// The residual r alone.
inline double sampson_residual(const Eigen::Matrix3d& essential, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector3d line_b = essential * a.homogeneous(), line_a = essential.transpose() * b.homogeneous();
  const double d = line_b.head<2>().squaredNorm() + line_a.head<2>().squaredNorm();
  return b.homogeneous().dot(line_b) / std::sqrt(d);
}

// Two unit axes perpendicular to the base, as columns. They are the tangent plane in which the base moves.
inline Eigen::Matrix<double, 3, 2> axes_across(const Eigen::Vector3d& base) {
  Eigen::Matrix<double, 3, 2> axes;
  axes.col(0) = base.unitOrthogonal();
  axes.col(1) = base.cross(axes.col(0));
  return axes;
}

// The residual of a match and its derivatives.
class SampsonEquations {
 public:
  explicit SampsonEquations(const RelativeOrientation& o)
      : rotation_(o.rotation.toRotationMatrix()),
        essential_(skew<double>(o.base) * rotation_),
        across_(axes_across(o.base)) {}

  // Evaluates the residual of a match. Returns false where it is not defined (both points in the epipoles).
  bool at(const Eigen::Vector2d& point_a, const Eigen::Vector2d& point_b) {
    a_ = point_a.homogeneous();
    b_ = point_b.homogeneous();
    line_b_.noalias() = essential_ * a_;
    line_a_.noalias() = essential_.transpose() * b_;
    square_ = line_b_.head<2>().squaredNorm() + line_a_.head<2>().squaredNorm();
    if (!(square_ > 0)) return false;
    n_ = b_.dot(line_b_);
    residual = n_ / std::sqrt(square_);
    return true;
  }
  double residual = 0;

  // Derivative of the residual by the coordinates of b, then of a, to first order; a unit vector.
  Eigen::Vector4d by_points() const {
    Eigen::Vector4d normal;
    normal << line_b_.head<2>(), line_a_.head<2>();
    return normal / std::sqrt(square_);
  }

  // Derivative by w (3) and by the base along axes_across (2): d(n / sqrt(d)) = (dn - (n / d) (dd / 2)) / sqrt(d).
  Eigen::Matrix<double, 5, 1> derivative() const {
    const Eigen::Vector3d flat_b(line_b_.x(), line_b_.y(), 0), flat_a(line_a_.x(), line_a_.y(), 0);
    const Eigen::Vector3d turned = rotation_ * a_;
    Eigen::Vector3d n_base = turned.cross(b_);
    Eigen::Vector3d half_base = turned.cross(flat_b) - b_.cross(rotation_ * flat_a);
    Eigen::Vector3d n_rotation = a_.cross(line_a_);
    Eigen::Vector3d half_rotation = a_.cross(essential_.transpose() * flat_b) + flat_a.cross(line_a_);
    const double root = 1 / std::sqrt(square_), share = n_ / square_;
    Eigen::Matrix<double, 5, 1> j;
    j << root * (n_rotation - share * half_rotation), root * (across_.transpose() * (n_base - share * half_base));
    return j;
  }

  // Contribution of the errors of both points to the squared derivative by the base, for an image coordinate of
  // variance one. The parallax that determines the base contains these errors; without a base it contains nothing else.
  Eigen::Matrix2d base_noise() const {
    const Eigen::Matrix<double, 2, 3> in_b = skew<double>(rotation_ * a_).topRows<2>(),
                                      in_a = rotation_.leftCols<2>().transpose() * skew<double>(b_);
    return across_.transpose() * (in_b.transpose() * in_b + in_a.transpose() * in_a) * across_ / square_;
  }

 private:
  Eigen::Matrix3d rotation_, essential_;
  Eigen::Matrix<double, 3, 2> across_;
  Eigen::Vector3d a_, b_, line_a_, line_b_;
  double n_ = 0, square_ = 0;
};

}  // namespace megablock
