// Corrects a viewing ray for refraction in the atmosphere and for the curvature of the earth.
//
// Both turn a ray in its vertical plane by an amount that depends on its angle theta from the nadir. H and h are the
// heights of camera and ground above sea level, D = H - h, and R is the earth's radius:
//
//   refraction   theta_seen = theta + K tan(theta)                               the ray is seen farther outward
//                K = 1e-6 (2410 H / (H^2 - 6 H + 250) - 2410 h / (h^2 - 6 h + 250) h / H),  H and h in kilometres
//   curvature    tan(theta_true) = tan(theta) / (1 + c tan(theta)^2),  c = D / (2 R)
//                theta belongs to a point at the horizontal distance d = D tan(theta) in a frame of grid coordinates
//                and heights; the point lies d^2 / (2 R) below the horizontal plane of that frame.
//
// In a vertical image with the principal distance p these are, to first order, the corrections of the textbooks:
// outward by K (r + r^3/p^2) and inward by D r^3 / (2 R p^2). In the form above they hold for oblique images and every
// camera model. The curvature is inverted in closed form: tan(theta) = 2 t / (1 + sqrt(1 - 4 c t^2)) with
// t = tan(theta_true). The refraction is inverted by Newton's method, to rounding.
//
// Beyond 80 degrees from the nadir the correction keeps its value at 80 degrees, as K is not valid near the horizon.
#pragma once

#include <Eigen/Core>

#include "geometry/camera/intrinsics.h"

namespace megablock {

inline constexpr double kEarthRadiusM = 6.371e6;

// The two constants; zero turns nothing.
struct EnvironmentEffect {
  double refraction = 0;  // K, radians
  double curvature = 0;   // c, without unit
};

// K from heights above sea level in metres. They must refer to the sea level, as the density of the air depends on it.
// Returns 0 where the camera is not above the ground. Ground below the sea counts as sea level, and the camera as that
// much higher.
double refraction_constant(double camera_height_m, double ground_height_m);
// c from the height of the camera above the ground point in metres; 0 where it is not above.
double curvature_constant(double height_above_ground_m);

// Angle from the nadir, radians. seen_angle() converts from the geometry of the ground frame to what the camera sees,
// geometric_angle() back.
double seen_angle(const EnvironmentEffect& effect, double angle);
double geometric_angle(const EnvironmentEffect& effect, double angle);

// The same for a unit ray. `down` is the unit vector to the nadir in the axes of the ray.
Eigen::Vector3d seen_ray(const EnvironmentEffect& effect, const Eigen::Vector3d& ray, const Eigen::Vector3d& down);
Eigen::Vector3d geometric_ray(const EnvironmentEffect& effect, const Eigen::Vector3d& ray, const Eigen::Vector3d& down);

// The same for a pixel, with `down` in camera axes. NaN where the camera has no ray for the pixel, or no pixel for the
// turned ray.
Eigen::Vector2d seen_pixel(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                           const Eigen::Vector3d& down);
Eigen::Vector2d geometric_pixel(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                                const Eigen::Vector3d& down);

}  // namespace megablock
