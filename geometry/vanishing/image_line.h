// Straight lines in an image with their covariance (Kalantari 2009, M14), and the feet of their perpendiculars (M25).
//
// A line is rho = -x sin(theta) + y cos(theta): theta its direction, rho its signed distance from the origin. Of n
// points with centre (xb, yb), a = sum (x - xb)^2, b = 2 sum (x - xb)(y - yb), c = sum (y - yb)^2 and an error sigma in
// each coordinate, orthogonal regression gives
//
//     theta = atan2(b, a - c) / 2,   rho = yb cos(theta) - xb sin(theta),   d = xb cos(theta) + yb sin(theta)
//     Cov(theta, rho) = sigma^2 (a + c) / ((a - c)^2 + b^2) |  1  -d  | + | 0      0     |
//                                                           | -d  d^2 |   | 0  sigma^2/n |
//
// for errors that are independent from point to point. Two ends of a segment are the case n = 2.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>

namespace megablock {

struct ImageLine {
  double theta = 0, rho = 0;   // radians, px
  Eigen::Matrix2d covariance;  // of (theta, rho)

  Eigen::Vector2d along() const { return {std::cos(theta), std::sin(theta)}; }
  Eigen::Vector2d across() const { return {-std::sin(theta), std::cos(theta)}; }
};

// Empty for fewer than two places, points without a direction, numbers that are not finite and sigma <= 0.
std::optional<ImageLine> fit_image_line(std::span<const Eigen::Vector2d> points, double sigma_px);

// The same line in axes that begin at `origin`.
ImageLine line_about(const ImageLine& line, const Eigen::Vector2d& origin);

// The point of the line that is nearest to the origin.
struct LineFoot {
  Eigen::Vector2d point;
  Eigen::Matrix2d covariance;
};
LineFoot foot_of(const ImageLine& line);

// Two points of the line that carry its whole covariance: their errors are independent, sigma in each coordinate.
// For an edge measured all along they lie 1 / sqrt(12) of its length to either side of the middle, which is where the
// line that is fitted to an arc meets it: to an edge bent by distortion they belong all the same.
struct LinePoints {
  Eigen::Vector2d first, second;
  double sigma_px = 0;
};
LinePoints independent_points(const ImageLine& line);

}  // namespace megablock
