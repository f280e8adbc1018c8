// Intersection of the two or more rays of one point: one solution (B. Cannelle 2013, CN-18, for the linear start; R.
// Hartley and P. Sturm, "Triangulation", CVIU 68(2), 1997, for what it leaves to the refinement).
//
// Linear start: every ray gives M - lambda_i v_i = A_i with the point M, the projection centre A_i, the unit direction
// v_i and the unknown distance lambda_i. Least squares eliminates lambda_i = v_i' (M - A_i) and leaves
//
//     sum_i w_i (I - v_i v_i') (M - A_i) = 0,
//
// a 3x3 system in M, solved relative to the mean of the A_i. The residual of a ray is the distance of the point from
// it, in metres: near rays weigh too little, so the refinement follows, Gauss-Newton on the pixel residuals.
//
// Degenerate: all rays parallel: the point is far away, or on the line of the centres; all from one centre.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"

namespace megablock {

struct Ray {
  Eigen::Vector3d origin;     // projection centre, ground frame, metres
  Eigen::Vector3d direction;  // unit, from the projection centre towards the point
  double weight = 1;          // of the squared distance; > 0
};

// Ray of a pixel in the ground frame, `camera` from camera_pose(); empty where the distortion cannot be inverted.
std::optional<Ray> ground_ray(const Pose& camera, const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

// The point nearest to all rays; empty with fewer than two rays, rays parallel within about 1e-6 rad, one centre for
// all but for rounding, or a point behind one of the projection centres.
std::optional<Eigen::Vector3d> intersect_rays(std::span<const Ray> rays);

// One image measurement of a point.
struct PointView {
  Pose camera;  // of the single camera, from camera_pose()
  const Intrinsics* intrinsics = nullptr;
  Eigen::Vector2d pixel;
  double inverse_sigma = 1;  // 1/px
};

struct RefinedPoint {
  Eigen::Vector3d position;
  double squared_error = 0;  // sum of squared residuals, each divided by its sigma
};

// Minimises the squared pixel residuals over the point, by Gauss-Newton with step halving. Empty when a view sees the
// point behind it, the normal matrix is singular or the iterations do not converge: to a step shorter than `settled`
// sigmas.
inline constexpr double kSettledPoint = 1e-6;
std::optional<RefinedPoint> refine_point(const Eigen::Vector3d& start, std::span<const PointView> views,
                                         int max_iterations = 20, double settled = kSettledPoint);

// Linear intersection and refinement.
std::optional<RefinedPoint> triangulate(std::span<const PointView> views, double settled = kSettledPoint);

// Largest angle at the point between two of its rays, radians in [0, pi].
double max_intersection_angle(const Eigen::Vector3d& point, std::span<const Eigen::Vector3d> centres);

}  // namespace megablock
