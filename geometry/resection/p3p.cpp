#include "geometry/resection/p3p.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/transform/triangle_pose.h"

namespace megablock {

namespace {

// A pair of lines in homogeneous coordinates.
using Lines = std::array<Eigen::Vector3d, 2>;

// Coefficients of det(a + x b) in ascending order.
std::array<double, 4> determinant(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Vector3d aa = a.col(1).cross(a.col(2)), bb = b.col(1).cross(b.col(2));
  const Eigen::Vector3d ab = a.col(1).cross(b.col(2)) + b.col(1).cross(a.col(2));
  return {a.col(0).dot(aa), b.col(0).dot(aa) + a.col(0).dot(ab), a.col(0).dot(bb) + b.col(0).dot(ab), b.col(0).dot(bb)};
}

// The real root of x^3 + b x^2 + c x + d that is the farthest from the inflection point. The start lies beyond it, so
// Newton's iteration approaches it from outside and cannot cross it.
double outer_root(double b, double c, double d) {
  const double inflection = -b / 3, p = c - b * b / 3;
  const double value = ((inflection + b) * inflection + c) * inflection + d;
  double x =
      inflection - std::copysign(std::max(2 * std::sqrt(std::max(0.0, -p / 3)), std::cbrt(std::abs(value))), value);
  for (int iteration = 0; iteration < 50; ++iteration) {
    const double step = (((x + b) * x + c) * x + d) / ((3 * x + 2 * b) * x + c);
    if (!std::isfinite(step)) break;
    x -= step;
    if (std::abs(step) <= 1e-15 * std::abs(x)) break;
  }
  return x;
}

// A singular conic of the pencil a + x b. The cubic det(a + x b) is divided by the larger of its two outer
// coefficients, which keeps the root finite.
Eigen::Matrix3d degenerate_conic(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const auto [k0, k1, k2, k3] = determinant(a, b);
  if (k0 == 0 && k3 == 0) return a;  // a camera on the axis of an equilateral triangle
  if (std::abs(k3) >= std::abs(k0)) return a + outer_root(k2 / k3, k1 / k3, k0 / k3) * b;
  return b + outer_root(k1 / k0, k2 / k0, k3 / k0) * a;
}

// Splits a singular conic into its lines. A symmetric matrix C of rank two is l m' + m l'. With p = l x m, -adj
// C = p p', and C + [p]x is a multiple of l m', whose rows and columns are the lines. Empty where the lines are
// complex.
std::optional<Lines> lines_of(const Eigen::Matrix3d& conic) {
  Eigen::Matrix3d square;
  square << -conic.col(1).cross(conic.col(2)), -conic.col(2).cross(conic.col(0)), -conic.col(0).cross(conic.col(1));
  int k = 0;
  if (!(square.diagonal().maxCoeff(&k) > 0)) return std::nullopt;
  const Eigen::Vector3d p = square.col(k) / std::sqrt(square(k, k));
  Eigen::Matrix3d product = conic;
  product(0, 1) -= p[2], product(1, 0) += p[2];
  product(0, 2) += p[1], product(2, 0) -= p[1];
  product(1, 2) -= p[0], product(2, 1) += p[0];
  int row = 0, column = 0;
  product.cwiseAbs().maxCoeff(&row, &column);
  return Lines{product.row(row).transpose(), product.col(column)};
}

// Intersects a line of the singular conic with the other two conics. Returns points up to size and sign. A discriminant
// that is negative only by rounding counts as zero, which gives one (double) point.
Solutions<Eigen::Vector3d, 2> meet(const Eigen::Vector3d& line, const Eigen::Matrix3d& first,
                                   const Eigen::Matrix3d& second) {
  constexpr double kDoublePoint = 1e-9;
  int m = 0;
  line.cwiseAbs().maxCoeff(&m);
  Eigen::Vector3d u = Eigen::Vector3d::Zero(), v = Eigen::Vector3d::Zero();  // two points of the line
  const int i = (m + 1) % 3, j = (m + 2) % 3;
  u[i] = v[j] = 1;
  u[m] = -line[i] / line[m];
  v[m] = -line[j] / line[m];
  // On the line both conics are the same quadratic up to a factor (which may be zero for one of them): with a point
  // u + x v of the line, a + 2 b x + c x^2 = 0. The one with larger coefficients is solved.
  const auto along = [&](const Eigen::Matrix3d& conic) {
    const Eigen::Vector3d cu = conic * u;
    return Eigen::Vector3d(u.dot(cu), v.dot(cu), v.dot(conic * v));
  };
  const Eigen::Vector3d by_first = along(first), by_second = along(second);
  const Eigen::Vector3d& q = by_first.squaredNorm() > by_second.squaredNorm() ? by_first : by_second;
  const double a = q[0], b = q[1], c = q[2];
  const double discriminant = b * b - a * c;
  if (!(discriminant >= -kDoublePoint * (b * b + std::abs(a * c)))) return {};
  // Avoids cancellation; x = w / c or a / w.
  const double root = std::sqrt(std::max(0.0, discriminant)), w = -b - std::copysign(root, b);
  Solutions<Eigen::Vector3d, 2> points;
  points.push_back(c * u + w * v);
  if (root > 0) points.push_back(w * u + a * v);
  return points;
}

// The three cosine laws of the distances s along the rays, for the pairs (1, 2), (0, 2), (0, 1). They are written with
// the chords of the unit vectors, s_i^2 + s_j^2 - 2 s_i s_j cos = (s_i - s_j)^2 + s_i s_j chord^2: for narrow angles
// the cosine is one to rounding and would lose the angle.
struct CosineLaws {
  Eigen::Vector3d chord_squared, side_squared;

  Eigen::Vector3d sides_squared(const Eigen::Vector3d& s) const {
    const Eigen::Vector3d difference(s[1] - s[2], s[0] - s[2], s[0] - s[1]);
    const Eigen::Vector3d product(s[1] * s[2], s[0] * s[2], s[0] * s[1]);
    return difference.cwiseAbs2() + product.cwiseProduct(chord_squared);
  }

  // Newton's iteration. Returns false when it does not converge to a solution in front of the camera.
  bool polish(Eigen::Vector3d& s) const {
    constexpr double kSettled = 1e-9;  // relative; the error after such a step is about its square
    constexpr int kIterations = 20;  // two or three suffice; towards a double solution each step only halves the error
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Eigen::Vector3d f = sides_squared(s) - side_squared;
      // The Jacobian's rows are (0, a, b), (c, 0, d), (e, g, 0).
      const double a = 2 * (s[1] - s[2]) + s[2] * chord_squared[0], b = 2 * (s[2] - s[1]) + s[1] * chord_squared[0];
      const double c = 2 * (s[0] - s[2]) + s[2] * chord_squared[1], d = 2 * (s[2] - s[0]) + s[0] * chord_squared[1];
      const double e = 2 * (s[0] - s[1]) + s[1] * chord_squared[2], g = 2 * (s[1] - s[0]) + s[0] * chord_squared[2];
      const Eigen::Vector3d step =
          Eigen::Vector3d(b * g * f[1] + d * (a * f[2] - g * f[0]), d * e * f[0] + b * (c * f[2] - e * f[1]),
                          c * g * f[0] + a * (e * f[1] - c * f[2])) /
          (a * d * e + b * c * g);
      if (!(step.squaredNorm() < s.squaredNorm())) break;
      s -= step;
      if (step.squaredNorm() < kSettled * kSettled * s.squaredNorm()) break;
    }
    return (s.array() > 0).all() && (sides_squared(s) - side_squared).norm() < 1e-6 * side_squared.norm();
  }
};

}  // namespace

Solutions<Pose, 4> solve_p3p(const std::array<Eigen::Vector3d, 3>& rays, const std::array<Eigen::Vector3d, 3>& points) {
  const auto squared_distances = [](const std::array<Eigen::Vector3d, 3>& p) -> Eigen::Vector3d {
    return {(p[1] - p[2]).squaredNorm(), (p[0] - p[2]).squaredNorm(), (p[0] - p[1]).squaredNorm()};
  };
  const CosineLaws laws{squared_distances(rays), squared_distances(points)};
  const double size = laws.side_squared.sum();
  const double area = (points[1] - points[0]).cross(points[2] - points[0]).norm();
  if (!(area > kMinTriangleArea * size)) return {};

  const auto [a, b, c] =
      std::array{laws.side_squared[0] / size, laws.side_squared[1] / size, laws.side_squared[2] / size};
  const auto [ca, cb, cg] = std::array{rays[1].dot(rays[2]), rays[0].dot(rays[2]), rays[0].dot(rays[1])};
  // A times the law of (0, 2) minus b times that of (1, 2), and likewise with (0, 1): combinations without constant
  // term.
  Eigen::Matrix3d second, third;
  second << a, 0, -a * cb, 0, -b, b * ca, -a * cb, b * ca, a - b;
  third << a, -a * cg, 0, -a * cg, a - c, c * ca, 0, c * ca, -c;
  const std::optional<Lines> lines = lines_of(degenerate_conic(second, third));
  if (!lines) return {};

  Solutions<Pose, 4> poses;
  for (const Eigen::Vector3d& line : *lines)
    for (Eigen::Vector3d s : meet(line, second, third)) {
      // The conics are homogeneous: the sum of the three laws gives the size of s, and its sign must make all distances
      // positive.
      s *= std::copysign(std::sqrt(size / laws.sides_squared(s).sum()), s.sum());
      if (!(s.array() > 0).all() || !laws.polish(s)) continue;
      if (const auto pose = triangle_pose({s[0] * rays[0], s[1] * rays[1], s[2] * rays[2]}, points))
        poses.push_back(*pose);
    }
  return poses;
}

}  // namespace megablock
