#include "geometry/intersection/triangulation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/numbers/decompositions.h"

namespace megablock {

std::optional<Ray> ground_ray(const Pose& camera, const Intrinsics& intrinsics, const Eigen::Vector2d& pixel) {
  const auto direction = viewing_ray(intrinsics, pixel);
  if (!direction) return std::nullopt;
  return Ray{camera.centre, camera.rotation.conjugate() * *direction};
}

std::optional<Eigen::Vector3d> intersect_rays(std::span<const Ray> rays) {
  if (rays.size() < 2) return std::nullopt;
  // Sums are taken relative to the mean of the centres, because ground coordinates are large.
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();
  double weights = 0;
  for (const Ray& ray : rays) {
    reference += ray.origin;
    weights += ray.weight;
  }
  reference /= static_cast<double>(rays.size());

  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double farthest = 0;
  for (const Ray& ray : rays) {
    farthest = std::max(farthest, (ray.origin - reference).squaredNorm());
    const Eigen::Matrix3d across =
        ray.weight * (Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose());
    normal += across;
    right += across * (ray.origin - reference);
  }
  // If all centres coincide up to rounding there is no base, and chance would decide on which side the point lies.
  constexpr double kRounding = 16 * std::numeric_limits<double>::epsilon();
  if (!(farthest > kRounding * kRounding * reference.squaredNorm())) return std::nullopt;
  // The smallest eigenvalue over the sum of weights is about the square of the spread of the directions (radians).
  const SymmetricEigen3 eigen = symmetric_eigen3(normal);
  constexpr double kParallel = 1e-12;
  if (!(eigen.values(0) > kParallel * weights)) return std::nullopt;
  const Eigen::Vector3d offset = eigen.vectors * (eigen.vectors.transpose() * right).cwiseQuotient(eigen.values);
  for (const Ray& ray : rays)
    if (!(ray.direction.dot(offset - (ray.origin - reference)) > 0)) return std::nullopt;
  return reference + offset;
}

namespace {

// Normal equations of a Gauss-Newton iteration for the three coordinates of the point.
struct PointEquations {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // J' r
  double squared_error = 0;
};

// Returns false when the point is not in front of every camera.
bool linearise(const Eigen::Vector3d& point, std::span<const PointView> views, PointEquations& equations) {
  equations = {};
  for (const PointView& view : views) {
    const ProjectionJacobian projection = project_with_jacobian(*view.intrinsics, to_inside(view.camera, point));
    if (!projection.valid) return false;
    const Eigen::Vector2d residual =
        pixel_difference(*view.intrinsics, projection.pixel, view.pixel) * view.inverse_sigma;
    const Eigen::Matrix<double, 2, 3> jacobian =
        view.inverse_sigma * projection.by_point * view.camera.rotation.toRotationMatrix();
    equations.normal += jacobian.transpose() * jacobian;
    equations.gradient += jacobian.transpose() * residual;
    equations.squared_error += residual.squaredNorm();
  }
  return std::isfinite(equations.squared_error);
}

}  // namespace

std::optional<RefinedPoint> refine_point(const Eigen::Vector3d& start, std::span<const PointView> views,
                                         int max_iterations, double settled) {
  RefinedPoint result{start};
  PointEquations equations;
  if (views.size() < 2 || !linearise(start, views, equations)) return std::nullopt;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Eigen::LDLT<Eigen::Matrix3d> factor(equations.normal);
    if (factor.info() != Eigen::Success || !(factor.rcond() > 1e-16)) return std::nullopt;
    const Eigen::Vector3d step = -factor.solve(equations.gradient);
    const double decrement = -step.dot(equations.gradient);  // squared length of the step in sigmas
    if (!std::isfinite(decrement)) return std::nullopt;

    PointEquations next;
    double length = 1;
    // Halve the step until the cost does not rise.
    constexpr int kMaxHalvings = 10;
    int halvings = 0;
    while (!linearise(result.position + length * step, views, next) || next.squared_error > equations.squared_error) {
      if (++halvings > kMaxHalvings) break;
      length *= 0.5;
    }
    const bool improved = halvings <= kMaxHalvings;
    if (improved) {
      result.position += length * step;
      equations = next;
    }
    // Converged: either the step is short, or rounding prevents a further fall of the cost and the step is nearly
    // short.
    if (decrement < settled * settled || (!improved && decrement < 1e-8 * (1 + equations.squared_error))) {
      result.squared_error = equations.squared_error;
      return result;
    }
    if (!improved) return std::nullopt;
  }
  return std::nullopt;
}

std::optional<RefinedPoint> triangulate(std::span<const PointView> views, double settled) {
  std::vector<Ray> rays;
  rays.reserve(views.size());
  for (const PointView& view : views) {
    const auto ray = ground_ray(view.camera, *view.intrinsics, view.pixel);
    if (!ray) return std::nullopt;
    rays.push_back(*ray);
  }
  const auto start = intersect_rays(rays);
  if (!start) return std::nullopt;
  return refine_point(*start, views, 20, settled);
}

double max_intersection_angle(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> centres) {
  double largest = 0;
  for (std::size_t i = 0; i < centres.size(); ++i)
    for (std::size_t j = i + 1; j < centres.size(); ++j) {
      const Eigen::Vector3d a = centres[i] - point, b = centres[j] - point;
      largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  return largest;
}

}  // namespace megablock
