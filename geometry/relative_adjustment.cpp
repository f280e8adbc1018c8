#include "geometry/relative_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "geometry/decompositions.h"
#include "geometry/median.h"

namespace megablock {

namespace {

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

// Residual of a pair with its derivatives.
class SampsonEquations {
 public:
  explicit SampsonEquations(const RelativeOrientation& o)
      : rotation_(o.rotation.toRotationMatrix()),
        essential_(skew<double>(o.base) * rotation_),
        across_(axes_across(o.base)) {}

  // False where the residual is not defined.
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

  Vector5 derivative() const {
    const Eigen::Vector3d flat_b(line_b_.x(), line_b_.y(), 0), flat_a(line_a_.x(), line_a_.y(), 0);
    const Eigen::Vector3d turned = rotation_ * a_;
    Eigen::Vector3d n_base = turned.cross(b_);
    Eigen::Vector3d half_base = turned.cross(flat_b) - b_.cross(rotation_ * flat_a);
    Eigen::Vector3d n_rotation = a_.cross(line_a_);
    Eigen::Vector3d half_rotation = a_.cross(essential_.transpose() * flat_b) + flat_a.cross(line_a_);
    const double root = 1 / std::sqrt(square_), share = n_ / square_;
    Vector5 j;
    j << root * (n_rotation - share * half_rotation), root * (across_.transpose() * (n_base - share * half_base));
    return j;
  }

  // What the errors of both points add to the square of the derivative by the base, over those of a coordinate: the
  // parallax that determines the base has the points' own errors in it, and without a base nothing else.
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

struct NormalEquations {
  Matrix5 normal = Matrix5::Zero();
  Vector5 gradient = Vector5::Zero();
  double cost = 0;
};

// Geman-McClure: rho(r) = r^2 / (1 + r^2/s^2), weight 1 / (1 + r^2/s^2)^2; its reach is about 3 s.
NormalEquations normal_equations(const RelativeOrientation& o, const PointPairs& points, double scale,
                                 std::size_t stride, std::span<const double> weights) {
  SampsonEquations equations(o);
  NormalEquations sum;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const double given = weights.empty() ? 1 : weights[i];
    if (given == 0 || !equations.at(points.a[i], points.b[i])) continue;
    const double r = equations.residual, q = 1 + r * r / (scale * scale), weight = given / (q * q);
    sum.cost += given * r * r / q;
    if (weight < 1e-3) continue;
    const Vector5 j = equations.derivative();
    for (int column = 0; column < 5; ++column) {
      const double weighted = weight * j[column];
      for (int row = column; row < 5; ++row) sum.normal(row, column) += weighted * j[row];
      sum.gradient[column] += weighted * r;
    }
  }
  sum.normal.triangularView<Eigen::StrictlyUpper>() = sum.normal.transpose();
  return sum;
}

RelativeOrientation updated(const RelativeOrientation& o, const Vector5& step) {
  return {rotation_update(o.rotation, step.head<3>()), (o.base + axes_across(o.base) * step.tail<2>()).normalized()};
}

OrientationPrecision precision_from(const Matrix5& normal, double variance) {
  constexpr double kOpen = 1 / (std::numbers::pi * std::numbers::pi);  // weight of a direction that is open
  OrientationPrecision result;
  result.sigma = std::sqrt(variance);
  const SymmetricEigen eigen = symmetric_eigen(normal / variance);
  const Vector5 weights = eigen.values.cwiseMax(kOpen);
  if (!weights.allFinite()) return result;
  result.covariance = eigen.vectors * weights.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
  return result;
}

double largest_sigma(const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  return std::sqrt(symmetric_eigen(covariance).values.maxCoeff());
}

}  // namespace

Vector5 sampson_derivative(const RelativeOrientation& orientation, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  SampsonEquations equations(orientation);
  return equations.at(a, b) ? equations.derivative() : Vector5::Zero();
}

double intersection_angle(const Eigen::Quaterniond& rotation, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector3d u = rotation * a.homogeneous(), v = b.homogeneous();
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

Eigen::Matrix<double, 3, 2> axes_across(const Eigen::Vector3d& base) {
  Eigen::Matrix<double, 3, 2> axes;
  axes.col(0) = base.unitOrthogonal();
  axes.col(1) = base.cross(axes.col(0));
  return axes;
}

RelativeOrientation adjust_orientation(const RelativeOrientation& start, const PointPairs& points,
                                       const RelativeAdjustment& by, std::span<const double> weights) {
  const std::size_t stride =
      by.max_pairs == 0 ? 1 : std::max<std::size_t>(1, (points.size() + by.max_pairs - 1) / by.max_pairs);
  RelativeOrientation o = start;
  NormalEquations current = normal_equations(o, points, by.scale, stride, weights);
  double damping = 1e-6;
  for (int iteration = 0; iteration < by.max_iterations; ++iteration) {
    Matrix5 damped = current.normal;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += 1e-12 * current.normal.trace();
    const Vector5 step = -damped.ldlt().solve(current.gradient);
    if (!step.allFinite()) break;
    const RelativeOrientation next = updated(o, step);
    const NormalEquations there = normal_equations(next, points, by.scale, stride, weights);
    if (there.cost < current.cost) {
      o = next;
      current = there;
      damping = std::max(damping * 0.1, 1e-9);
    } else {
      damping *= 100;
      if (damping > 1e6) break;
    }
    if (step.norm() < by.tolerance) break;
  }
  return o;
}

std::vector<double> leverage_weights(const RelativeOrientation& orientation, const PointPairs& points,
                                     std::span<const std::uint8_t> inlier) {
  constexpr double kMost = 3;  // times the median
  SampsonEquations equations(orientation);
  std::vector<Vector5> derivatives(points.size(), Vector5::Zero());
  Matrix5 normal = Matrix5::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!inlier[i] || !equations.at(points.a[i], points.b[i])) continue;
    derivatives[i] = equations.derivative();
    normal.noalias() += derivatives[i] * derivatives[i].transpose();
  }
  normal.diagonal().array() += 1e-12 * normal.trace();
  const Eigen::LDLT<Matrix5> factor(normal);
  std::vector<double> weights(points.size(), 0), leverages;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (inlier[i]) {
      weights[i] = derivatives[i].dot(factor.solve(derivatives[i]));
      leverages.push_back(weights[i]);
    }
  if (leverages.empty()) return weights;
  const double most = kMost * median(std::move(leverages));
  for (std::size_t i = 0; i < points.size(); ++i)
    if (inlier[i]) weights[i] = weights[i] > most ? most / weights[i] : 1;
  return weights;
}

double OrientationPrecision::rotation_sigma() const { return largest_sigma(covariance.topLeftCorner<3, 3>()); }
double OrientationPrecision::base_sigma() const { return largest_sigma(covariance.bottomRightCorner<2, 2>()); }

OrientationPrecision precision_of(const RelativeOrientation& orientation, const PointPairs& points,
                                  std::span<const std::uint8_t> inlier, double scale, double min_sigma,
                                  std::span<const double> weights) {
  SampsonEquations equations(orientation);
  Matrix5 normal = Matrix5::Zero();
  Eigen::Matrix2d noise = Eigen::Matrix2d::Zero();
  double squares = 0, slopes = 0, count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!inlier[i] || !equations.at(points.a[i], points.b[i])) continue;
    const double weight = weights.empty() ? 1 : weights[i];
    const Vector5 j = equations.derivative();
    normal.noalias() += weight * j * j.transpose();
    noise += weight * equations.base_noise();
    const double r = equations.residual, share = r * r / (scale * scale), q = 1 + share;
    squares += weight * r * r / (q * q * q * q);
    slopes += weight * (1 - 3 * share) / (q * q * q);
    count += weight;
  }
  if (!(count >= 6) || !(slopes > 0)) return {};
  const double variance = std::max(min_sigma * min_sigma, squares * count / (slopes * slopes) * count / (count - 5));
  normal.bottomRightCorner<2, 2>() -= variance * noise;
  return precision_from(normal, variance);
}

OrientationPrecision precision_of_rotation(const Eigen::Quaterniond& rotation, std::span<const Eigen::Vector3d> a,
                                           std::span<const Eigen::Vector3d> b, double min_sigma) {
  Matrix5 normal = Matrix5::Zero();
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::Matrix3d by_rotation = skew<double>(a[i]);
    normal.topLeftCorner<3, 3>() += by_rotation.transpose() * by_rotation;
    squares += (rotation * a[i] - b[i]).squaredNorm();
  }
  const double redundancy = 2 * static_cast<double>(a.size()) - 3;
  if (!(redundancy > 0)) return {};
  return precision_from(normal, std::max(min_sigma * min_sigma, squares / redundancy));
}

}  // namespace megablock
