// Gives straight lines in an image with their covariance (Kalantari 2009, chapter 2), and the feet of the
// perpendiculars from the origin to them (chapter 5).
//
// A line is rho = -x sin(theta) + y cos(theta), where theta is its direction and rho its signed distance from the
// origin, in pixels. Orthogonal regression fits it to n points with the centroid (xb, yb). With a = sum (x - xb)^2,
// b = 2 sum (x - xb)(y - yb), c = sum (y - yb)^2 and the standard deviation sigma of each coordinate,
//
//     theta = atan2(b, a - c) / 2,   rho = yb cos(theta) - xb sin(theta),   d = xb cos(theta) + yb sin(theta)
//     Cov(theta, rho) = sigma^2 (a + c) / ((a - c)^2 + b^2) |  1  -d  | + | 0      0     |
//                                                           | -d  d^2 |   | 0  sigma^2/n |
//
// provided that the errors of the points are independent. The two end points of a segment are the case n = 2.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>

namespace megablock {

struct ImageLine {
  double theta = 0, rho = 0;   // radians, pixels
  Eigen::Matrix2d covariance;  // of (theta, rho)

  // Unit vectors in the direction of the line and perpendicular to it.
  Eigen::Vector2d along() const { return {std::cos(theta), std::sin(theta)}; }
  Eigen::Vector2d across() const { return {-std::sin(theta), std::cos(theta)}; }
};

// Fits a line to points in pixels; `sigma_px` is the standard deviation of a coordinate. Empty for fewer than two
// points, for points without a direction, for input that is not finite, and for sigma_px <= 0.
std::optional<ImageLine> fit_image_line(std::span<const Eigen::Vector2d> points, double sigma_px);

// The same line in coordinates that start at `origin`.
ImageLine line_about(const ImageLine& line, const Eigen::Vector2d& origin);

// The point of the line nearest to the origin, with its covariance (pixels).
struct LineFoot {
  Eigen::Vector2d point;
  Eigen::Matrix2d covariance;
};
LineFoot foot_of(const ImageLine& line);

// Two points of the line that carry its whole covariance: their errors are independent, with the standard deviation
// `sigma_px` in each coordinate. For an edge measured along its whole length they lie 1 / sqrt(12) of the length to
// either side of the middle. That is where a line fitted to an arc meets the arc; so the two points lie on the edge
// even if distortion bends it.
struct LinePoints {
  Eigen::Vector2d first, second;
  double sigma_px = 0;
};
LinePoints independent_points(const ImageLine& line);

}  // namespace megablock
