#include "geometry/similarity/minimal_control.h"

#include <cmath>
#include <complex>
#include <optional>

#include "geometry/numbers/polynomial.h"
#include "geometry/transform/triangle_pose.h"

namespace megablock {

namespace {

// The plane of a triangle, by two of its sides.
struct TrianglePlane {
  Eigen::Vector3d first, second, normal;  // normal: unit
  double squared_area = 0;                // |first x second|^2

  // Empty for points on one line.
  static std::optional<TrianglePlane> of(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
    TrianglePlane plane{b - a, c - a, {}};
    const Eigen::Vector3d cross = plane.first.cross(plane.second);
    const double area = cross.norm();
    if (!(area > kMinTriangleArea * (plane.first.squaredNorm() + plane.second.squaredNorm()))) return std::nullopt;
    plane.normal = cross / area;
    plane.squared_area = area * area;
    return plane;
  }
  // Returns the vector in the plane whose scalar products with the two sides have the given values.
  Eigen::Vector3d with_products(double by_first, double by_second) const {
    const Eigen::Vector3d cross = std::sqrt(squared_area) * normal;
    return (by_first * second.cross(cross) + by_second * cross.cross(first)) / squared_area;
  }
};

// A similarity without translation, from its scale and the rows of its rotation. Empty where these are not finite.
std::optional<Similarity> from_rows(double scale, const Eigen::Vector3d& r1, const Eigen::Vector3d& r2,
                                    const Eigen::Vector3d& r3) {
  Eigen::Matrix3d rotation;
  rotation << r1.transpose(), r2.transpose(), r3.transpose();
  Similarity s;
  s.scale = scale;
  s.rotation = Eigen::Quaterniond(rotation).normalized();
  if (!(scale > 0) || !s.rotation.coeffs().allFinite()) return std::nullopt;
  return s;
}

// Sets the translation to the mean misfit: of the planimetric points in X and Y, of the height points in Z. Returns
// false where it is not finite.
template <std::size_t Places, std::size_t Heights>
bool translate(const std::array<PlaceControl, Places>& places, const std::array<HeightControl, Heights>& heights,
               Similarity& s) {
  for (const PlaceControl& p : places)
    s.translation.head<2>() += (p.ground - (s.scale * (s.rotation * p.model)).head<2>()) / static_cast<double>(Places);
  for (const HeightControl& h : heights)
    s.translation.z() += (h.ground - (s.scale * (s.rotation * h.model)).z()) / static_cast<double>(Heights);
  return s.translation.allFinite();
}

}  // namespace

Solutions<Similarity, 2> solve_minimal_control(const std::array<PlaceControl, 2>& places,
                                               const std::array<HeightControl, 3>& heights) {
  Solutions<Similarity, 2> found;
  const auto plane = TrianglePlane::of(heights[0].model, heights[1].model, heights[2].model);
  if (!plane) return found;
  const Eigen::Vector3d u0 =
      plane->with_products(heights[1].ground - heights[0].ground, heights[2].ground - heights[0].ground);
  const Eigen::Vector3d d = places[1].model - places[0].model;
  const Eigen::Vector2d across = places[1].ground - places[0].ground;
  const double distance = across.norm();
  // k is counted in units of the expected scale, which makes the coefficients of the quadratic comparable.
  const double unit = distance / d.norm();
  const Eigen::Vector3d constant = u0.cross(d) / distance, slope = unit * plane->normal.cross(d) / distance;
  if (!(slope.squaredNorm() > 1e-12)) return found;
  const Polynomial<2> quadratic = {constant.squaredNorm() - 1, 2 * constant.dot(slope), slope.squaredNorm()};
  for (const double k : real_roots(quadratic)) {
    const Eigen::Vector3d u = u0 + k * unit * plane->normal;
    const double scale = u.norm();
    const Eigen::Vector3d r3 = u / scale, along = (d - r3 * r3.dot(d)).normalized(), left = r3.cross(along);
    const Eigen::Vector3d r1 = (across.x() * along - across.y() * left) / distance;
    auto s = from_rows(scale, r1, r3.cross(r1), r3);
    if (s && translate(places, heights, *s)) found.push_back(*s);
  }
  return found;
}

Solutions<Similarity, 2> solve_minimal_control(const std::array<PlaceControl, 3>& places, const HeightControl& height) {
  Solutions<Similarity, 2> found;
  const auto plane = TrianglePlane::of(places[0].model, places[1].model, places[2].model);
  if (!plane) return found;
  // p and q are found in the plane of the points first; the complex root then gives their components along the normal.
  const Eigen::Vector2d first = places[1].ground - places[0].ground, second = places[2].ground - places[0].ground;
  const Eigen::Vector3d p0 = plane->with_products(first.x(), second.x()),
                        q0 = plane->with_products(first.y(), second.y());
  const std::complex<double> root =
      std::sqrt(std::complex<double>(q0.squaredNorm() - p0.squaredNorm(), -2 * p0.dot(q0)));
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d p = p0 + sign * root.real() * plane->normal, q = q0 + sign * root.imag() * plane->normal;
    const double scale = std::sqrt(0.5 * (p.squaredNorm() + q.squaredNorm()));
    auto s = from_rows(scale, p / scale, q / scale, (p / scale).cross(q / scale));
    if (s && translate(places, std::array{height}, *s)) found.push_back(*s);
    if (std::abs(root) < 1e-9 * scale) break;  // both solutions are one
  }
  return found;
}

}  // namespace megablock
