#include "geometry/p3p.h"

#include <Eigen/LU>
#include <cmath>

#include "geometry/polynomial.h"
#include "geometry/triangle_pose.h"

namespace megablock {

namespace {

// Newton on s_i^2 + s_j^2 - 2 s_i s_j cos_ij = side_ij^2 for (i, j) = (1,2), (0,2), (0,1); false when it ends
// elsewhere.
bool polish(const Eigen::Vector3d& cosine, const Eigen::Vector3d& side_squared, Eigen::Vector3d& s) {
  constexpr int kOneEnd[3] = {1, 0, 0}, kOtherEnd[3] = {2, 2, 1};
  double error = 0;
  for (int iteration = 0; iteration < 6; ++iteration) {
    Eigen::Vector3d f;
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = kOneEnd[k], j = kOtherEnd[k];
      f[k] = s[i] * s[i] + s[j] * s[j] - 2 * s[i] * s[j] * cosine[k] - side_squared[k];
      jacobian(k, i) = 2 * (s[i] - s[j] * cosine[k]);
      jacobian(k, j) = 2 * (s[j] - s[i] * cosine[k]);
    }
    error = f.norm();
    if (error < 1e-15 * s.squaredNorm()) break;  // what rounding leaves
    const Eigen::Vector3d step = jacobian.partialPivLu().solve(f);
    if (!step.allFinite() || step.norm() > s.norm()) break;
    s -= step;
  }
  return (s.array() > 0).all() && error < 1e-6 * side_squared.norm();
}

}  // namespace

Solutions<Pose, 4> solve_p3p(const std::array<Eigen::Vector3d, 3>& rays, const std::array<Eigen::Vector3d, 3>& points) {
  const Eigen::Vector3d cosine(rays[1].dot(rays[2]), rays[0].dot(rays[2]), rays[0].dot(rays[1]));
  const Eigen::Vector3d side_squared((points[1] - points[2]).squaredNorm(), (points[0] - points[2]).squaredNorm(),
                                     (points[0] - points[1]).squaredNorm());
  const double area = (points[1] - points[0]).cross(points[2] - points[0]).norm();
  if (!(area > kMinTriangleArea * side_squared.sum())) return {};
  const auto [ca, cb, cg] = std::array{cosine[0], cosine[1], cosine[2]};
  const double a = side_squared[0] / side_squared[1], c = side_squared[2] / side_squared[1];
  const double d = a - c, e = a + c;
  const Polynomial<4> quartic = {
      (1 + d) * (1 + d) - 4 * a * cg * cg, 4 * (-d * (1 + d) * cb + 2 * a * cg * cg * cb - (1 - e) * ca * cg),
      2 * (d * d - 1 + 2 * d * d * cb * cb + 2 * (1 - c) * ca * ca - 4 * e * ca * cb * cg + 2 * (1 - a) * cg * cg),
      4 * (d * (1 - d) * cb - (1 - e) * ca * cg + 2 * c * ca * ca * cb), (d - 1) * (d - 1) - 4 * c * ca * ca};

  Solutions<Pose, 4> poses;
  for (const double v : real_roots(quartic)) {
    const double divisor = 2 * (cg - v * ca);
    const double first_squared = side_squared[1] / (1 + v * v - 2 * v * cb);
    if (!(v > 0) || std::abs(divisor) < 1e-12 || !(first_squared > 0)) continue;
    const double u = ((d - 1) * v * v - 2 * d * cb * v + 1 + d) / divisor;
    Eigen::Vector3d distance = std::sqrt(first_squared) * Eigen::Vector3d(1, u, v);
    if (!(u > 0) || !polish(cosine, side_squared, distance)) continue;
    if (const auto pose = triangle_pose({distance[0] * rays[0], distance[1] * rays[1], distance[2] * rays[2]}, points))
      poses.push_back(*pose);
  }
  return poses;
}

}  // namespace megablock
