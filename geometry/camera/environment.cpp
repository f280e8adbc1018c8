#include "geometry/camera/environment.h"

#include <algorithm>
#include <cmath>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"

namespace megablock {

namespace {

// Angle from the nadir beyond which the formulas are not used any more.
constexpr double kLargestAngle = 80 * kDegree;

double refraction_term(double height_km) { return 2410 * height_km / (height_km * height_km - 6 * height_km + 250); }

// seen_angle() for an angle below the limit.
double seen_within(const EnvironmentEffect& effect, double angle) {
  const double t = std::tan(angle), true_t = t / (1 + effect.curvature * t * t);
  return std::atan(true_t) + effect.refraction * true_t;
}

// Solves theta + K tan(theta) = seen by Newton's method. K is of the order of 1e-5, so five iterations reach rounding.
double without_refraction(double constant, double seen) {
  double angle = seen;
  for (int i = 0; i < 5; ++i) {
    const double t = std::tan(angle);
    angle -= (angle + constant * t - seen) / (1 + constant * (1 + t * t));
  }
  return angle;
}

using AngleChange = double (*)(const EnvironmentEffect&, double);

// Turns a unit ray in its vertical plane so that its angle from the nadir becomes change(angle).
Eigen::Vector3d turned(const EnvironmentEffect& effect, const Eigen::Vector3d& ray, const Eigen::Vector3d& down,
                       AngleChange change) {
  const double along = ray.dot(down);
  const Eigen::Vector3d across = ray - along * down;
  const double sine = across.norm();
  if (!(sine > 0)) return ray;
  const double angle = change(effect, std::atan2(sine, along));
  return std::cos(angle) * down + std::sin(angle) / sine * across;
}

Eigen::Vector2d turned(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                       const Eigen::Vector3d& down, AngleChange change) {
  const auto ray = viewing_ray(camera, pixel);
  return ray ? project(camera, turned(effect, *ray, down, change)) : no_pixel();
}

}  // namespace

double refraction_constant(double camera_height_m, double ground_height_m) {
  if (!(camera_height_m > ground_height_m)) return 0;
  const double lift = std::max(0.0, -ground_height_m);  // the formula has a pole where the camera is at sea level
  const double camera = 1e-3 * (camera_height_m + lift), ground = 1e-3 * (ground_height_m + lift);
  return 1e-6 * (refraction_term(camera) - refraction_term(ground) * (ground / camera));
}

double curvature_constant(double height_above_ground_m) {
  return std::max(0.0, height_above_ground_m) / (2 * kEarthRadiusM);
}

double seen_angle(const EnvironmentEffect& effect, double angle) {
  if (angle <= kLargestAngle) return seen_within(effect, angle);
  return angle + seen_within(effect, kLargestAngle) - kLargestAngle;
}

double geometric_angle(const EnvironmentEffect& effect, double angle) {
  const double limit = seen_within(effect, kLargestAngle);
  if (angle > limit) return angle + kLargestAngle - limit;
  const double t = std::tan(without_refraction(effect.refraction, angle));
  return std::atan(2 * t / (1 + std::sqrt(1 - 4 * effect.curvature * t * t)));
}

Eigen::Vector3d seen_ray(const EnvironmentEffect& effect, const Eigen::Vector3d& ray, const Eigen::Vector3d& down) {
  return turned(effect, ray, down, seen_angle);
}

Eigen::Vector3d geometric_ray(const EnvironmentEffect& effect, const Eigen::Vector3d& ray,
                              const Eigen::Vector3d& down) {
  return turned(effect, ray, down, geometric_angle);
}

Eigen::Vector2d seen_pixel(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                           const Eigen::Vector3d& down) {
  return turned(effect, camera, pixel, down, seen_angle);
}

Eigen::Vector2d geometric_pixel(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                                const Eigen::Vector3d& down) {
  return turned(effect, camera, pixel, down, geometric_angle);
}

}  // namespace megablock
