#include "geometry/two_view/coplanarity.h"

#include <cmath>

namespace megablock {

XyzAngles xyz_angles(const Eigen::Quaterniond& rotation_cw) {
  const Eigen::Matrix3d r = rotation_cw.toRotationMatrix();
  return {std::atan2(r(2, 1), r(2, 2)), std::atan2(-r(2, 0), std::hypot(r(2, 1), r(2, 2))),
          std::atan2(r(1, 0), r(0, 0))};
}

Eigen::Quaterniond rotation_from(const XyzAngles& a) {
  return Eigen::AngleAxisd(a.gamma, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(a.beta, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(a.alpha, Eigen::Vector3d::UnitX());
}

AngledRay angled_ray(const XyzAngles& a, const Eigen::Vector2d& image, double focal) {
  const double ca = std::cos(a.alpha), sa = std::sin(a.alpha), cb = std::cos(a.beta), sb = std::sin(a.beta),
               cg = std::cos(a.gamma), sg = std::sin(a.gamma);
  const double u = cg * image.x() + sg * image.y(), v = -sg * image.x() + cg * image.y(), w = sb * u + focal * cb;
  AngledRay ray;
  const double d1 = cb * u - focal * sb;
  ray.direction = {d1, ca * v + sa * w, -sa * v + ca * w};
  ray.derivatives.col(0) = Eigen::Vector3d(0, ray.direction.z(), -ray.direction.y());
  ray.derivatives.col(1) = Eigen::Vector3d(-w, sa * d1, ca * d1);
  // By u and v, with du = v dgamma + cg dx + sg dy and dv = -u dgamma - sg dx + cg dy.
  const Eigen::Vector3d by_u(cb, sa * sb, ca * sb), by_v(0, ca, -sa);
  ray.derivatives.col(2) = v * by_u - u * by_v;
  ray.derivatives.col(3) = cg * by_u - sg * by_v;
  ray.derivatives.col(4) = sg * by_u + cg * by_v;
  return ray;
}

CoplanarityDeterminant coplanarity_determinant(const Eigen::Vector3d& base, double focal, const XyzAngles& first,
                                               const Eigen::Vector2d& image_first, const XyzAngles& second,
                                               const Eigen::Vector2d& image_second) {
  const AngledRay p = angled_ray(first, image_first, focal), q = angled_ray(second, image_second, focal);
  const double scale = 1 / (focal * focal);
  const Eigen::Vector3d by_p = scale * q.direction.cross(base), by_q = scale * base.cross(p.direction);
  return {by_p.dot(p.direction), by_p.transpose() * p.derivatives, by_q.transpose() * q.derivatives};
}

}  // namespace megablock
