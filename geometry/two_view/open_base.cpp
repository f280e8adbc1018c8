#include "geometry/two_view/open_base.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/two_view/sampson.h"

namespace megablock {

namespace {

constexpr double kFarthest = 75 * kDegree;  // a base that may be this far from the estimate is undetermined
constexpr double kHardlyAny = 10;           // a ray ends where D S / (S + K) exceeds this
constexpr double kChosen = 4;               // standard deviations of the errors' part in K, see open_base.h
constexpr int kRays = 8;
constexpr double kStep = 0.9, kGrowth = 1.15;  // step along a ray in units of the ray, and the factor by which it grows

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

double square(double x) { return x * x; }

// The odds of other bases against the estimate.
class BaseOdds {
 public:
  // A base, with all that is evaluated there.
  struct Place {
    RelativeOrientation orientation;               // with the best rotation for this base
    Eigen::Matrix<double, 3, 2> rotation_by_base;  // derivative of that rotation along axes_across of the base
    Eigen::Matrix3d rotation_covariance;           // with the base held fixed
    double cost = 0;                               // C
    double told = 0;                               // S / (S + K)
    double exponent = 0;                           // D S / (S + K), minus twice the logarithm of the odds
  };

  BaseOdds(const RelativeOrientation& estimate, const PointPairs& points, std::span<const double> weights,
           const BaseCost& cost)
      : cost_(cost), across_(axes_across(estimate.base)) {
    SampsonEquations equations(estimate);
    double count = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (weights[i] == 0 || !equations.at(points.a[i], points.b[i])) continue;
      const Eigen::Vector4d m = equations.by_points(), correction = -equations.residual * m;
      matches_.push_back({points.a[i], points.b[i], points.a[i] + correction.tail<2>(),
                          points.b[i] + correction.head<2>(), m, weights[i]});
      count += weights[i];
      noise_ += weights[i] * square(equations.residual / tail(equations.residual));
    }
    noise_ /= cost_.slope * (count - 5);
    estimate_ = evaluated(estimate);
    estimate_.orientation = estimate;
  }
  const Place& estimate() const { return estimate_; }

  // Evaluates the base that is turned from the estimate by `angles` along axes_across of the estimate. Its rotation is
  // predicted from the place `near`.
  Place at(const Eigen::Vector2d& angles, const Place& near) const {
    const double angle = angles.norm(), along = angle > 0 ? std::sin(angle) / angle : 1;
    RelativeOrientation o;
    o.base = (std::cos(angle) * estimate_.orientation.base + along * (across_ * angles)).normalized();
    const Eigen::Vector2d moved = axes_across(near.orientation.base).transpose() * o.base;
    o.rotation = rotation_update(near.orientation.rotation, near.rotation_by_base * moved);
    Place place = evaluated(o);
    place.exponent = (place.cost - estimate_.cost) * place.told;
    return place;
  }

  // Difference of a place from the estimate: rotation vector (3) and turn of the base (2), radians.
  Vector5 difference(const Place& place, const Eigen::Vector2d& angles) const {
    Vector5 e;
    e << rotation_log<double>((estimate_.orientation.rotation.conjugate() * place.orientation.rotation).normalized()),
        angles;
    return e;
  }

 private:
  struct Match {
    Eigen::Vector2d a, b, corrected_a, corrected_b;
    Eigen::Vector4d m;  // unit derivative of the residual at the estimate
    double weight;
  };

  double tail(double residual) const { return 1 + square(residual / cost_.scale); }

  // Improves the rotation by one Newton step and evaluates everything except the exponent.
  Place evaluated(const RelativeOrientation& o) const {
    SampsonEquations equations(o);
    Eigen::Matrix<double, 3, 5> normal = Eigen::Matrix<double, 3, 5>::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero(), of_corrected = Eigen::Vector3d::Zero();
    double sum = 0, corrected_sum = 0, turned = 0, spread = 0;
    for (const Match& match : matches_) {
      if (!equations.at(match.a, match.b)) continue;
      const double r = equations.residual, q = tail(r);
      const double same = equations.by_points().dot(match.m);
      const Vector5 j = equations.derivative();
      const Eigen::Vector3d weighted = match.weight * j.head<3>();
      normal.noalias() += weighted * j.transpose();
      gradient += r / (q * q) * weighted;
      sum += match.weight * r * r / q;
      // k of the head: the part of the error that the turn of m brings in.
      const double turn = 1 - same * same;
      turned += match.weight * turn;
      spread += square(match.weight * turn);
      if (!equations.at(match.corrected_a, match.corrected_b)) continue;
      of_corrected += equations.residual * weighted;
      corrected_sum += match.weight * equations.residual * equations.residual;
    }
    const Eigen::LDLT<Eigen::Matrix3d> factor(normal.leftCols<3>());
    const Eigen::Vector3d step = -factor.solve(gradient) / cost_.slope;
    Place place;
    place.orientation = {rotation_update(o.rotation, step), o.base};
    place.rotation_by_base = -factor.solve(normal.rightCols<2>());
    place.rotation_covariance = cost_.variance * factor.solve(Eigen::Matrix3d::Identity());
    place.cost = (sum + gradient.dot(step)) / (cost_.slope * cost_.variance);
    // S + K and K of the head, both times sigma^2.
    const double both = corrected_sum - of_corrected.dot(factor.solve(of_corrected));
    const double by_errors = noise_ * (turned + kChosen * std::sqrt(2 * spread));
    place.told = both > by_errors ? 1 - by_errors / both : 0;
    return place;
  }

  const BaseCost& cost_;
  Eigen::Matrix<double, 3, 2> across_;
  std::vector<Match> matches_;
  Place estimate_;
  double noise_ = 0;  // variance of an image coordinate
};

// The angle in this direction at which D S / (S + K) is about one, at most kFarthest. `about` is a first guess.
double unit_along(const BaseOdds& odds, const Eigen::Vector2d& direction, double about) {
  constexpr int kRounds = 5;
  constexpr double kLargest = 10 * kDegree;  // for the first guess
  double unit = std::min(about, kLargest);
  for (int round = 0; round < kRounds; ++round) {
    const double exponent = odds.at(unit * direction, odds.estimate()).exponent;
    // The exponent rises with the 2nd to 4th power of the angle.
    const double factor = std::cbrt(1 / std::clamp(exponent, 1.0 / 64, 64.0));
    unit *= factor;
    if (factor > 0.6 && factor < 1.6) break;
    if (unit > kFarthest) return kFarthest;
  }
  return unit;
}

// Sums of the second moment over the rays. add_ray() returns false where a ray does not end before kFarthest.
class Moment {
 public:
  bool add_ray(const BaseOdds& odds, const Eigen::Vector2d& direction) {
    double last = 0, distance = kStep;
    BaseOdds::Place place = odds.at(distance * direction, odds.estimate());
    for (int halving = 0; halving < 10 && !(place.exponent < 0.5 * kHardlyAny); ++halving) {
      distance *= 0.5;
      place = odds.at(distance * direction, odds.estimate());
    }
    double step = distance;
    while (place.exponent < kHardlyAny) {
      const Eigen::Vector2d angles = distance * direction;
      if (!(angles.norm() < kFarthest)) return false;
      step *= kGrowth;
      const Vector5 e = odds.difference(place, angles);
      // The weight is the area in polar coordinates times the odds. No base may count for more than the estimate.
      const double weight = distance * 0.5 * (distance + step - last) * std::exp(-0.5 * std::max(0.0, place.exponent));
      sum_.noalias() += weight * e * e.transpose();
      weights_ += weight;
      last = distance;
      distance += step;
      place = odds.at(distance * direction, place);
    }
    return true;
  }
  Matrix5 mean() const { return sum_ / weights_; }

 private:
  Matrix5 sum_ = Matrix5::Zero();
  double weights_ = 0;
};

}  // namespace

std::optional<Matrix5> covariance_of_open_base(const RelativeOrientation& estimate, const Eigen::Matrix2d& linear,
                                               const PointPairs& points, std::span<const double> weights,
                                               const BaseCost& cost) {
  const BaseOdds odds(estimate, points, weights, cost);
  const SymmetricEigen eigen = symmetric_eigen(linear);
  Eigen::Matrix2d axes = eigen.vectors;
  for (int i = 0; i < 2; ++i) {
    const double about = std::sqrt(eigen.values[i]);
    axes.col(i) *= std::sqrt(unit_along(odds, axes.col(i), about) * unit_along(odds, -axes.col(i), about));
  }
  Moment rays;
  for (int ray = 0; ray < kRays; ++ray) {
    const double turn = 2 * std::numbers::pi * (ray + 0.5) / kRays;
    if (!rays.add_ray(odds, axes * Eigen::Vector2d(std::cos(turn), std::sin(turn)))) return std::nullopt;
  }
  Matrix5 moment = rays.mean();
  moment.topLeftCorner<3, 3>() += odds.estimate().rotation_covariance;
  if (!moment.allFinite()) return std::nullopt;
  return moment;
}

}  // namespace megablock
