#include "geometry/camera/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace megablock {

namespace {

// The function `correct` of a model that corrects the measured pixel.
Correct correct_of(const CameraModel& model) {
  return with_model(model.kind, []<typename Model>(std::type_identity<Model>) -> Correct {
    if constexpr (Model::kCorrectsPixels) return &Model::correct;
    return nullptr;
  });
}

}  // namespace

Eigen::Vector2d project_other(const Intrinsics& k, const Eigen::Vector3d& point) {
  const int order = k.model().order;
  return with_model(k.model().kind, [&]<typename Model>(std::type_identity<Model>) -> Eigen::Vector2d {
    return Model::sees(order, k.data(), point) ? Model::template project<double>(order, k.data(), point) : no_pixel();
  });
}

ProjectionJacobian project_with_jacobian(const Intrinsics& k, const Eigen::Vector3d& point) {
  ProjectionJacobian result;
  result.valid = with_model(k.model().kind, [&]<typename Model>(std::type_identity<Model>) {
    return Model::linearise(k.model().order, k.data(), point, result);
  });
  return result;
}

std::optional<Eigen::Vector2d> unproject(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const int order = k.model().order;
  return with_model(k.model().kind, [&]<typename Model>(std::type_identity<Model>) -> std::optional<Eigen::Vector2d> {
    if constexpr (Model::kField == FieldOfView::kFront) {
      return Model::normalised(order, k.data(), pixel);
    } else {
      const auto ray = Model::viewing_ray(order, k.data(), pixel);
      if (!ray || !(ray->z() > 0)) return std::nullopt;
      return Eigen::Vector2d(ray->x() / ray->z(), ray->y() / ray->z());
    }
  });
}

std::optional<Eigen::Vector3d> viewing_ray(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  const int order = k.model().order;
  return with_model(k.model().kind, [&]<typename Model>(std::type_identity<Model>) -> std::optional<Eigen::Vector3d> {
    if constexpr (Model::kField == FieldOfView::kFront) {
      const auto p = Model::normalised(order, k.data(), pixel);
      if (!p) return std::nullopt;
      return Eigen::Vector3d(p->x(), p->y(), 1).normalized();
    } else {
      return Model::viewing_ray(order, k.data(), pixel);
    }
  });
}

Correction correction_at(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  return correct_of(k.model())(k.model().order, k.data(), pixel, false);
}

Eigen::Vector2d solve_correction(const Intrinsics& k, const Eigen::Vector2d& corrected) {
  return solve_correction(correct_of(k.model()), k.model().order, k.data(), corrected);
}

Eigen::Matrix<double, 3, 2> tangent_plane(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.unitOrthogonal();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

RayJacobian ray_with_jacobian(const Intrinsics& k, const Eigen::Vector2d& pixel) {
  RayJacobian result;
  const auto ray = viewing_ray(k, pixel);
  if (!ray) return result;
  const ProjectionJacobian projection = project_with_jacobian(k, *ray);
  if (!projection.valid) return result;
  const Eigen::Matrix<double, 3, 2> tangent = tangent_plane(*ray);
  const Eigen::Matrix2d by_tangent = projection.by_point * tangent;
  result.ray = *ray;
  result.by_pixel = tangent * by_tangent.inverse();
  result.by_intrinsics = -result.by_pixel * projection.by_intrinsics;
  result.valid = result.by_pixel.allFinite();
  return result;
}

}  // namespace megablock
