#include "geometry/vanishing/image_line.h"

#include <algorithm>

#include "geometry/estimation/gauss_helmert.h"

namespace megablock {

std::optional<ImageLine> fit_image_line(std::span<const Eigen::Vector2d> points, double sigma_px) {
  if (points.size() < 2 || !(sigma_px > 0) || !std::isfinite(sigma_px)) return std::nullopt;
  const auto count = static_cast<double>(points.size());
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : points) centre += p / count;
  double a = 0, b = 0, c = 0;
  for (const Eigen::Vector2d& p : points) {
    const Eigen::Vector2d e = p - centre;
    a += e.x() * e.x();
    b += 2 * e.x() * e.y();
    c += e.y() * e.y();
  }
  const double elongation = (a - c) * (a - c) + b * b;
  // Points that scatter equally in all directions, or that coincide, have no direction.
  if (!centre.allFinite() || !std::isfinite(elongation) || !(elongation > 1e-12 * (a + c) * (a + c)) ||
      !(a + c > 1e-24 * centre.squaredNorm()))
    return std::nullopt;
  ImageLine line;
  line.theta = 0.5 * std::atan2(b, a - c);
  line.rho = line.across().dot(centre);
  const double d = line.along().dot(centre), variance = sigma_px * sigma_px;
  line.covariance << 1, -d, -d, d * d;
  line.covariance *= variance * (a + c) / elongation;
  line.covariance(1, 1) += variance / count;
  return line;
}

ImageLine line_about(const ImageLine& line, const Eigen::Vector2d& origin) {
  Eigen::Matrix2d j;
  j << 1, 0, line.along().dot(origin), 1;
  return {line.theta, line.rho - line.across().dot(origin), propagated(j, line.covariance)};
}

LinePoints independent_points(const ImageLine& line) {
  const Eigen::Matrix2d& c = line.covariance;
  // `middle` is where on the line its position across is most certain (the minimum of the variance along the line). At
  // the distance `half` from it, the uncertainty of the direction doubles the variance.
  const double middle = -c(0, 1) / c(0, 0), variance = std::max(0.0, c(1, 1) - c(0, 1) * c(0, 1) / c(0, 0));
  const double half = std::sqrt(variance / c(0, 0));
  const Eigen::Vector2d foot = line.rho * line.across();
  return {foot + (middle - half) * line.along(), foot + (middle + half) * line.along(), std::sqrt(2 * variance)};
}

LineFoot foot_of(const ImageLine& line) {
  Eigen::Matrix2d j;
  j << -line.rho * line.along(), line.across();
  return {line.rho * line.across(), propagated(j, line.covariance)};
}

}  // namespace megablock
