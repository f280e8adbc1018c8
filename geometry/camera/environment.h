// Corrections of the environment: what the atmosphere and the curved earth do to a viewing ray.
//
// Both turn a ray in the vertical plane that it lies in, by an amount that depends on its angle theta from the nadir.
// With the heights above sea level H of the camera and h of the ground, D = H - h and the earth's radius R:
//
//   refraction   theta_seen = theta + K tan(theta)                               the ray is seen farther outward
//                K = 1e-6 (2410 H / (H^2 - 6 H + 250) - 2410 h / (h^2 - 6 h + 250) h / H),  H and h in kilometres
//   curvature    tan(theta_true) = tan(theta) / (1 + c tan(theta)^2),  c = D / (2 R)
//                theta belongs to a point at the horizontal distance d = D tan(theta) in a frame of grid coordinates
//                and heights; the point lies d^2 / (2 R) below the horizontal plane of that frame.
//
// In a vertical photograph of principal distance p these are, to first order, the corrections of the textbooks:
// K (r + r^3/p^2) outward and D r^3 / (2 R p^2) inward. In this form they hold for tilted and oblique images and any
// camera model. The inverse of the curvature is closed: tan(theta) = 2 t / (1 + sqrt(1 - 4 c t^2)), t =
// tan(theta_true); that of the refraction is found by Newton's method, to rounding.
//
// Beyond 80 degrees from the nadir the turn stays what it is there; K says nothing near the horizon.
#pragma once

#include <Eigen/Core>

#include "geometry/camera/intrinsics.h"

namespace megablock {

inline constexpr double kEarthRadiusM = 6.371e6;

// Both zero: nothing is turned.
struct EnvironmentEffect {
  double refraction = 0;  // K, radians
  double curvature = 0;   // c
};

// Heights above sea level, metres, not above some other level: the air thins with them. 0 where the camera is not above
// the ground. Ground below the sea counts as at sea level, and the camera as that much higher.
double refraction_constant(double camera_height_m, double ground_height_m);
// Height of the camera above the ground point, metres; 0 where it is not above it.
double curvature_constant(double height_above_ground_m);

// Angle from the nadir, radians: from the geometry of the ground frame to what the camera sees, and back.
double seen_angle(const EnvironmentEffect& effect, double angle);
double geometric_angle(const EnvironmentEffect& effect, double angle);

// The same for a unit ray; `down`: unit vector to the nadir in the same axes.
Eigen::Vector3d seen_ray(const EnvironmentEffect& effect, const Eigen::Vector3d& ray, const Eigen::Vector3d& down);
Eigen::Vector3d geometric_ray(const EnvironmentEffect& effect, const Eigen::Vector3d& ray, const Eigen::Vector3d& down);

// The same for a pixel; `down` in the camera's axes. NaN where the camera has no ray for the pixel or no pixel for the
// turned ray.
Eigen::Vector2d seen_pixel(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                           const Eigen::Vector3d& down);
Eigen::Vector2d geometric_pixel(const EnvironmentEffect& effect, const Intrinsics& camera, const Eigen::Vector2d& pixel,
                                const Eigen::Vector3d& down);

}  // namespace megablock
