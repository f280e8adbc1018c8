#include "geometry/two_view/relative_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"
#include "geometry/two_view/open_base.h"

namespace megablock {

namespace {

// Standard deviation of the base (radians) above which the curvature may misrepresent it; then open_base.h decides.
constexpr double kLinear = 0.5 * kDegree;

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

struct NormalEquations {
  Matrix5 normal = Matrix5::Zero();
  Vector5 gradient = Vector5::Zero();
  double cost = 0;
};

// Normal equations with the Geman-McClure loss rho(r) = r^2 / (1 + r^2/s^2) and its weight 1 / (1 + r^2/s^2)^2.
// Residuals above about 5 s have no influence any more.
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

// Covariance from a normal matrix and the variance of a residual.
OrientationPrecision precision_from(const Matrix5& normal, double variance) {
  // Weight of an undetermined direction: sigma = pi.
  constexpr double kOpen = 1 / (std::numbers::pi * std::numbers::pi);
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

RelativeOrientation adjust_orientation(const RelativeOrientation& start, const PointPairs& points,
                                       const RelativeAdjustment& by, std::span<const double> weights) {
  const std::size_t stride =
      by.max_pairs == 0 ? 1 : std::max<std::size_t>(1, (points.size() + by.max_pairs - 1) / by.max_pairs);
  RelativeOrientation o = start;
  NormalEquations current = normal_equations(o, points, by.scale, stride, weights);
  double damping = 1e-6;
  // Levenberg-Marquardt; the small multiple of the trace keeps the matrix regular where the base is undetermined.
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
  constexpr double kMost = 3;  // limit, as a multiple of the median leverage
  SampsonEquations equations(orientation);
  std::vector<Vector5> derivatives(points.size(), Vector5::Zero());
  Matrix5 normal = Matrix5::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!inlier[i] || !equations.at(points.a[i], points.b[i])) continue;
    derivatives[i] = equations.derivative();
    normal.noalias() += derivatives[i] * derivatives[i].transpose();
  }
  // A small diagonal keeps the factorisation regular where a direction is undetermined.
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
  // Huber's estimate of the variance: mean(psi^2) / mean(psi')^2, corrected for the five unknowns.
  const double variance = std::max(min_sigma * min_sigma, squares * count / (slopes * slopes) * count / (count - 5));
  const Matrix5 with_noise = normal;
  normal.bottomRightCorner<2, 2>() -= variance * noise;
  OrientationPrecision result = precision_from(normal, variance);
  if (result.base_sigma() <= kLinear) return result;
  // A rough covariance of the base tells the search how far to look. The normal matrix before the correction gives one
  // that is always positive.
  const Eigen::Matrix2d about = precision_from(with_noise, variance).covariance.bottomRightCorner<2, 2>();
  if (!about.allFinite()) return result;
  std::vector<double> of_inliers(points.size(), 0);
  for (std::size_t i = 0; i < points.size(); ++i)
    if (inlier[i]) of_inliers[i] = weights.empty() ? 1 : weights[i];
  const BaseCost cost{scale, slopes / count, variance};
  if (const auto open = covariance_of_open_base(orientation, about, points, of_inliers, cost))
    result.covariance = *open;
  return result;
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
