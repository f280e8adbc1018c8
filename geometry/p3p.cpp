#include "geometry/p3p.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace megablock {

namespace {

// Real roots of c[0] + c[1] x + ... + c[4] x^4: eigenvalues of the companion matrix, polished.
std::vector<double> real_roots(const std::array<double, 5>& c) {
  const double largest =
      std::abs(*std::max_element(c.begin(), c.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
  if (!(std::abs(c[4]) > 1e-12 * largest)) return {};
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  companion.bottomLeftCorner<3, 3>().setIdentity();
  for (int i = 0; i < 4; ++i) companion(i, 3) = -c[static_cast<std::size_t>(i)] / c[4];
  const Eigen::Vector4cd values = companion.eigenvalues();
  std::vector<double> roots;
  for (const auto& value : values) {
    // Double roots split into a complex pair of about sqrt(eps); Newton below decides.
    if (std::abs(value.imag()) > 1e-4 * (1 + std::abs(value.real()))) continue;
    double x = value.real();
    for (int i = 0; i < 5; ++i) {
      const double f = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * c[4])));
      const double slope = c[1] + x * (2 * c[2] + x * (3 * c[3] + x * 4 * c[4]));
      if (slope == 0) break;
      x -= f / slope;
    }
    if (std::isfinite(x)) roots.push_back(x);
  }
  std::sort(roots.begin(), roots.end());
  return roots;
}

// Newton on s_i^2 + s_j^2 - 2 s_i s_j cos_ij = side_ij^2 for (i, j) = (1,2), (0,2), (0,1); false when it ends
// elsewhere.
bool polish(const Eigen::Vector3d& cosine, const Eigen::Vector3d& side_squared, Eigen::Vector3d& s) {
  constexpr int kFirst[3] = {1, 0, 0}, kSecond[3] = {2, 2, 1};
  double error = 0;
  for (int iteration = 0; iteration < 6; ++iteration) {
    Eigen::Vector3d f;
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = kFirst[k], j = kSecond[k];
      f[k] = s[i] * s[i] + s[j] * s[j] - 2 * s[i] * s[j] * cosine[k] - side_squared[k];
      jacobian(k, i) = 2 * (s[i] - s[j] * cosine[k]);
      jacobian(k, j) = 2 * (s[j] - s[i] * cosine[k]);
    }
    error = f.norm();
    if (error < 1e-14 * side_squared.norm()) break;
    const Eigen::Vector3d step = jacobian.partialPivLu().solve(f);
    if (!step.allFinite() || step.norm() > s.norm()) break;
    s -= step;
  }
  return (s.array() > 0).all() && error < 1e-6 * side_squared.norm();
}

// Orthonormal axes of a triangle.
Eigen::Matrix3d axes(const Eigen::Vector3d& p, const Eigen::Vector3d& q, const Eigen::Vector3d& r) {
  Eigen::Matrix3d result;
  result.col(0) = (q - p).normalized();
  result.col(2) = (q - p).cross(r - p).normalized();
  result.col(1) = result.col(2).cross(result.col(0));
  return result;
}

}  // namespace

std::vector<Pose> solve_p3p(const std::array<Eigen::Vector3d, 3>& rays, const std::array<Eigen::Vector3d, 3>& points) {
  const Eigen::Vector3d cosine(rays[1].dot(rays[2]), rays[0].dot(rays[2]), rays[0].dot(rays[1]));
  const Eigen::Vector3d side_squared((points[1] - points[2]).squaredNorm(), (points[0] - points[2]).squaredNorm(),
                                     (points[0] - points[1]).squaredNorm());
  const double area = (points[1] - points[0]).cross(points[2] - points[0]).norm();
  if (!(area > 1e-9 * side_squared.sum())) return {};
  const auto [ca, cb, cg] = std::array{cosine[0], cosine[1], cosine[2]};
  const double a = side_squared[0] / side_squared[1], c = side_squared[2] / side_squared[1];
  const double d = a - c, e = a + c;
  const std::array<double, 5> quartic = {
      (1 + d) * (1 + d) - 4 * a * cg * cg, 4 * (-d * (1 + d) * cb + 2 * a * cg * cg * cb - (1 - e) * ca * cg),
      2 * (d * d - 1 + 2 * d * d * cb * cb + 2 * (1 - c) * ca * ca - 4 * e * ca * cb * cg + 2 * (1 - a) * cg * cg),
      4 * (d * (1 - d) * cb - (1 - e) * ca * cg + 2 * c * ca * ca * cb), (d - 1) * (d - 1) - 4 * c * ca * ca};

  std::vector<Pose> poses;
  for (const double v : real_roots(quartic)) {
    const double divisor = 2 * (cg - v * ca);
    const double first_squared = side_squared[1] / (1 + v * v - 2 * v * cb);
    if (!(v > 0) || std::abs(divisor) < 1e-12 || !(first_squared > 0)) continue;
    const double u = ((d - 1) * v * v - 2 * d * cb * v + 1 + d) / divisor;
    Eigen::Vector3d distance = std::sqrt(first_squared) * Eigen::Vector3d(1, u, v);
    if (!(u > 0) || !polish(cosine, side_squared, distance)) continue;
    const Eigen::Vector3d in_camera = distance[0] * rays[0];
    const Eigen::Matrix3d rotation = axes(in_camera, distance[1] * rays[1], distance[2] * rays[2]) *
                                     axes(points[0], points[1], points[2]).transpose();
    if (!rotation.allFinite()) continue;
    const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
    poses.push_back({q, points[0] - q.conjugate() * in_camera});
  }
  return poses;
}

}  // namespace megablock
