#include "io/bal_camera.h"

namespace megablock {

namespace {

const Eigen::Matrix3d kFlip = Eigen::Vector3d(1, -1, -1).asDiagonal();

}  // namespace

BalCamera to_bal(const Pose& pose, const Intrinsics& k) {
  const Eigen::Matrix3d rotation = kFlip * pose.rotation.toRotationMatrix();
  return {rotation, -(rotation * pose.centre), k[kFocal], k[kRadial1], k[kRadial2]};
}

Pose pose_from_bal(const BalCamera& camera) {
  const Eigen::Matrix3d rotation = kFlip * camera.rotation;
  return {Eigen::Quaterniond(rotation).normalized(), -(camera.rotation.transpose() * camera.translation)};
}

std::optional<Eigen::Vector2d> to_bal_image(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  Eigen::Vector2d image(pixel.x() - k[kPrincipalX], k[kPrincipalY] - pixel.y());
  if (k[kRadial3] == 0 && k[kDecentring1] == 0 && k[kDecentring2] == 0) return image;
  const auto ray = unproject(k, pixel);
  if (!ray) return std::nullopt;
  const double r2 = ray->squaredNorm();
  const double scale = k[kFocal] * (1 + r2 * (k[kRadial1] + r2 * k[kRadial2]));
  return Eigen::Vector2d(scale * ray->x(), -scale * ray->y());
}

}  // namespace megablock
