#include "geometry/two_view/vertical_pair.h"

#include <algorithm>
#include <cmath>

#include "geometry/numbers/polynomial.h"
#include "geometry/vanishing/vertical.h"

namespace megablock {

namespace {

constexpr double kSameRay = 1e-20;   // squared distance of unit vectors that count as equal
constexpr double kFulfilled = 1e-6;  // sine of the angle between a ray and the plane of base and other ray

// Whether two of the rays coincide, or one is not finite.
bool any_same(const std::array<Eigen::Vector3d, 3>& rays) {
  return !((rays[0] - rays[1]).squaredNorm() > kSameRay && (rays[1] - rays[2]).squaredNorm() > kSameRay &&
           (rays[2] - rays[0]).squaredNorm() > kSameRay);
}

// The quartic det(c_1, c_2, c_3) / (1 + s^2) for levelled rays. Polynomial division by 1 + s^2 needs only differences
// of coefficients.
Polynomial<4> turn_quartic(const std::array<Eigen::Vector3d, 3>& a, const std::array<Eigen::Vector3d, 3>& b) {
  std::array<std::array<Polynomial<2>, 3>, 3> c;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& [ax, ay, az] = std::array{a[i].x(), a[i].y(), a[i].z()};
    const auto& [bx, by, bz] = std::array{b[i].x(), b[i].y(), b[i].z()};
    c[i][0] = {ay * bz - az * by, -2 * ax * by, ay * bz + az * by};
    const double across = az * bx - ax * bz;
    c[i][1] = {across, 2 * (ax * bx + az * bz), -across};
    c[i][2] = {ax * by - ay * bx, -2 * az * by, -(ax * by + ay * bx)};
  }
  const auto minor = [&](std::size_t j, std::size_t k) {
    return add(multiply(c[1][j], c[2][k]), multiply(c[1][k], c[2][j]), -1);
  };
  const Polynomial<6> d =
      add(add(multiply(c[0][0], minor(1, 2)), multiply(c[0][1], minor(2, 0))), multiply(c[0][2], minor(0, 1)));
  return {d[0], d[1], d[2] - d[0], d[5], d[6]};
}

}  // namespace

Solutions<RelativeOrientation, 4> solve_vertical_pair(const std::array<Eigen::Vector3d, 3>& a,
                                                      const std::array<Eigen::Vector3d, 3>& b,
                                                      const Eigen::Vector3d& vertical_a,
                                                      const Eigen::Vector3d& vertical_b) {
  Solutions<RelativeOrientation, 4> found;
  if (any_same(a) || any_same(b) || !(vertical_a + vertical_b).allFinite()) return found;
  const Eigen::Matrix3d level_a = levelling_rotation(vertical_a), level_b = levelling_rotation(vertical_b);
  std::array<Eigen::Vector3d, 3> u, v;
  for (std::size_t i = 0; i < 3; ++i) {
    u[i] = level_a * a[i];
    v[i] = level_b * b[i];
  }
  for (const ProjectiveRoot& root : projective_roots(turn_quartic(u, v))) {
    const double n2 = root.numerator * root.numerator, d2 = root.denominator * root.denominator;
    const double cosine = (d2 - n2) / (d2 + n2), sine = 2 * root.numerator * root.denominator / (d2 + n2);
    Eigen::Matrix3d turn;
    turn << cosine, 0, -sine, 0, 1, 0, sine, 0, cosine;
    const Eigen::Vector3d c0 = (turn * u[0]).cross(v[0]), c1 = (turn * u[1]).cross(v[1]),
                          c2 = (turn * u[2]).cross(v[2]);
    Eigen::Vector3d base = c0.cross(c1);
    for (const Eigen::Vector3d& other : {Eigen::Vector3d(c1.cross(c2)), Eigen::Vector3d(c2.cross(c0))})
      if (other.squaredNorm() > base.squaredNorm()) base = other;
    const double length = base.norm();
    // The length is of the order of the sine of the angle between two epipolar planes times two parallaxes.
    if (!(length > 1e-15)) continue;
    base /= length;
    // If all rows are parallel, their cross products contain only errors.
    if (!(std::max({std::abs(base.dot(c0)), std::abs(base.dot(c1)), std::abs(base.dot(c2))}) < kFulfilled)) continue;
    int front = 0, behind = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const ScaledDepths depths = scaled_depths(turn, base, u[i], v[i]);
      front += depths.a > 0 && depths.b > 0;
      behind += depths.a < 0 && depths.b < 0;
    }
    if (front != 3 && behind != 3) continue;
    if (behind == 3) base = -base;
    const Eigen::Matrix3d rotation = level_b.transpose() * turn * level_a;
    found.push_back({Eigen::Quaterniond(rotation).normalized(), level_b.transpose() * base});
  }
  return found;
}

}  // namespace megablock
