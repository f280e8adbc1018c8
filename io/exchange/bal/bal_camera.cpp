#include "io/exchange/bal/bal_camera.h"

#include <algorithm>

#include "io/base/error.h"

namespace megablock {

namespace {

const Eigen::Matrix3d kFlip = Eigen::Vector3d(1, -1, -1).asDiagonal();

bool is_brown(const Intrinsics& k) { return k.model().kind == CameraModelKind::kBrown; }

// Whether the camera is one of BAL: of Brown's model with f, k1 and k2 alone.
bool is_bal(const Intrinsics& k) {
  return is_brown(k) && std::all_of(k.begin() + kRadial3, k.end(), [](double value) { return value == 0; });
}

}  // namespace

void check_bal_model(const std::string& camera, const CameraModel& model) {
  if (!sees_sideways(model)) return;
  throw InputError("camera '" + camera + "' has the model " + model_name(model) +
                   ", whose images BAL and Bundler files cannot hold; choose another format");
}

BalCamera to_bal(const Pose& pose, const Intrinsics& k) {
  const Eigen::Matrix3d rotation = kFlip * pose.rotation.toRotationMatrix();
  return {rotation, -(rotation * pose.centre), k[kFocal], is_brown(k) ? k[kRadial1] : 0, is_brown(k) ? k[kRadial2] : 0};
}

Pose pose_from_bal(const BalCamera& camera) {
  const Eigen::Matrix3d rotation = kFlip * camera.rotation;
  return {Eigen::Quaterniond(rotation).normalized(), -(camera.rotation.transpose() * camera.translation)};
}

std::optional<Eigen::Vector2d> to_bal_image(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  Eigen::Vector2d image(pixel.x() - k[kPrincipalX], k[kPrincipalY] - pixel.y());
  // BAL's model is exactly this camera, so the pixel stays as it is.
  if (is_bal(k)) return image;
  if (k.model().kind == CameraModelKind::kPinhole) return image;
  const auto ray = unproject(k, pixel);
  if (!ray) return std::nullopt;
  // p' = f (1 + k1 r^2 + k2 r^4) (X/Z, -Y/Z): what BAL's camera would have measured of this ray.
  const double r2 = ray->squaredNorm();
  const double scale = is_brown(k) ? k[kFocal] * (1 + r2 * (k[kRadial1] + r2 * k[kRadial2])) : k[kFocal];
  return Eigen::Vector2d(scale * ray->x(), -scale * ray->y());
}

}  // namespace megablock
