// Intersects the rays of one tie point from two or more images. There is one solution. The linear start follows
// Cannelle (2013, appendix C); R. Hartley and P. Sturm, "Triangulation", CVIU 68(2), 1997, show what it lacks and why a
// refinement follows.
//
// Linear start. With the point M, the projection centre A_i, the unit direction v_i and the unknown distance lambda_i,
// every ray gives M - lambda_i v_i = A_i. Elimination of lambda_i = v_i' (M - A_i) leaves in least squares
//
//     sum_i w_i (I - v_i v_i') (M - A_i) = 0,
//
// a 3 x 3 system, solved relative to the mean of the A_i. This minimises distances of the point from the rays in
// metres, so that near rays count too little. The refinement therefore minimises the residuals in the images (pixels)
// by Gauss-Newton.
//
// Degenerate cases: parallel rays (the point is far away or on the line of the centres); a common centre of all rays.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"

namespace megablock {

// A ray in the ground frame.
struct Ray {
  Eigen::Vector3d origin;     // projection centre, ground frame, metres
  Eigen::Vector3d direction;  // unit, from the projection centre towards the point
  double weight = 1;          // weight of the squared distance from this ray, > 0
};

// Returns the ray of a pixel in the ground frame. `camera` is the pose from camera_pose(). Empty where the distortion
// cannot be inverted.
std::optional<Ray> ground_ray(const Pose& camera, const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

// Returns the point with the smallest weighted sum of squared distances from the rays, in the ground frame. Empty for
// fewer than two rays, for rays parallel within about 1e-6 rad, for a common centre of all rays (up to rounding), and
// for a point behind one of the centres.
std::optional<Eigen::Vector3d> intersect_rays(std::span<const Ray> rays);

// One observation of the point.
struct PointView {
  Pose camera;  // pose of the camera in the ground frame, from camera_pose()
  const Intrinsics* intrinsics = nullptr;
  Eigen::Vector2d pixel;
  double inverse_sigma = 1;  // 1/px
};

struct RefinedPoint {
  Eigen::Vector3d position;
  double squared_error = 0;  // sum of squared residuals, each in units of its sigma
};

// Minimises the sum of squared pixel residuals over the three coordinates, by Gauss-Newton with step halving. It
// converges when a step is shorter than `settled` (in standard deviations of the point). Empty for fewer than two
// views, when a camera has the point behind it, when the normal matrix is singular, and when the iterations do not
// converge.
inline constexpr double kSettledPoint = 1e-6;
std::optional<RefinedPoint> refine_point(const Eigen::Vector3d& start, std::span<const PointView> views,
                                         int max_iterations = 20, double settled = kSettledPoint);

// Linear intersection followed by the refinement. Empty where either is.
std::optional<RefinedPoint> triangulate(std::span<const PointView> views, double settled = kSettledPoint);

// Returns the largest angle at the point between two of its rays, radians in [0, pi]. It tells how well the distance of
// the point is determined.
double max_intersection_angle(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> centres);

}  // namespace megablock
