// Residuals, counts and least squares of a relative orientation.
//
//     E = [t]x R,  n = x_b' E x_a,  d = |(E x_a)_{1,2}|^2 + |(E' x_b)_{1,2}|^2,  r = n / sqrt(d)   (Sampson)
//
// r is the distance of the match from the nearest one that satisfies the epipolar equation, to first order. Unknowns:
// rotation (right perturbation, 3) and translation on the unit sphere (tangent plane, 2).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "match/two_view.h"

namespace megablock {

struct RelativePoseEstimate {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::UnitX();
};

double sampson_residual(const Eigen::Matrix3d& essential, const Eigen::Vector2d& a, const Eigen::Vector2d& b);

Eigen::Matrix3d essential_matrix(const RelativePoseEstimate& pose);

// The four orientations of an essential matrix (which need not be one exactly).
std::vector<RelativePoseEstimate> decompose_essential(const Eigen::Matrix3d& essential);

// Angle between the two rays of a match, radians.
double intersection_angle(const Eigen::Quaterniond& rotation, const Eigen::Vector2d& a, const Eigen::Vector2d& b);

// Matches within max_residual that intersect in front of both cameras (rays that are parallel within the residual
// count as in front), and their truncated quadratic score: sum of 1 - (r / max_residual)^2.
struct Support {
  std::vector<std::uint8_t> inlier;
  int count = 0;
  double score = 0;
};
Support support_of(const RelativePoseEstimate& pose, const PointPairs& points, double max_residual);
Support support_of_rotation(const Eigen::Quaterniond& rotation, const PointPairs& points, double max_residual);
Support support_of_fundamental(const Eigen::Matrix3d& fundamental, const PointPairs& points, double max_residual);

// Gauss-Newton on the Sampson residuals with Geman-McClure weights 1 / (1 + (r / scale)^2)^2, to convergence.
RelativePoseEstimate refine(const RelativePoseEstimate& start, const PointPairs& points, double scale);

// Rotation by least squares over the given matches (Kabsch on unit rays).
Eigen::Quaterniond fit_rotation(const PointPairs& points, const std::vector<std::size_t>& rows);

}  // namespace megablock
