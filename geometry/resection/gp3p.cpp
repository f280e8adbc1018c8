#include "geometry/resection/gp3p.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "geometry/numbers/polynomial.h"
#include "geometry/resection/p3p.h"
#include "geometry/transform/triangle_pose.h"

namespace megablock {

namespace {

using Corners = std::array<Eigen::Vector3d, 3>;
constexpr std::size_t kSideFirst[3] = {0, 0, 1}, kSideSecond[3] = {1, 2, 2};

Corners corners_at(const Corners& origins, const Corners& directions, const Eigen::Vector3d& s) {
  return {origins[0] + s[0] * directions[0], origins[1] + s[1] * directions[1], origins[2] + s[2] * directions[2]};
}

// Newton's iteration on the three quadrics. Returns false when it does not converge to a solution, or to one behind a
// camera.
bool polish(const Corners& origins, const Corners& directions, const Eigen::Vector3d& side_squared,
            Eigen::Vector3d& s) {
  double error = 0;
  for (int iteration = 0; iteration < 8; ++iteration) {
    const Corners p = corners_at(origins, directions, s);
    Eigen::Vector3d f;
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const std::size_t i = kSideFirst[k], j = kSideSecond[k];
      const Eigen::Vector3d side = p[i] - p[j];
      f[k] = side.squaredNorm() - side_squared[k];
      jacobian(k, static_cast<int>(i)) = 2 * side.dot(directions[i]);
      jacobian(k, static_cast<int>(j)) = -2 * side.dot(directions[j]);
    }
    error = f.norm();
    if (error < 1e-14 * side_squared.norm()) break;
    const Eigen::Vector3d step = jacobian.partialPivLu().solve(f);
    // A step longer than the distances and the triangle together means divergence; the test below then decides.
    if (!step.allFinite() || step.norm() > s.norm() + std::sqrt(side_squared.norm())) break;
    s -= step;
  }
  return (s.array() > 0).all() && error < 1e-6 * side_squared.norm();
}

// The octic in s_1, and the polynomials that give the other two distances at a root: s_3 = -V / U and
// s_2 = -(G s_3 + H) / (e s_3 + F).
struct Elimination {
  Polynomial<8> octic;
  Polynomial<3> u;
  Polynomial<4> v;
  Polynomial<1> f, g;
  Polynomial<2> h;
  double e;
};

Elimination eliminate(const Corners& o, const Corners& d, const Eigen::Vector3d& side_squared) {
  const Eigen::Vector3d o12 = o[0] - o[1], o13 = o[0] - o[2], o23 = o[1] - o[2];
  // First and second quadric: s_2^2 + b_2 s_2 + c_2 = 0 and s_3^2 + b_3 s_3 + c_3 = 0.
  const Polynomial<1> b2{-2 * d[1].dot(o12), -2 * d[0].dot(d[1])}, b3{-2 * d[2].dot(o13), -2 * d[0].dot(d[2])};
  const Polynomial<2> c2{o12.squaredNorm() - side_squared[0], 2 * d[0].dot(o12), 1};
  const Polynomial<2> c3{o13.squaredNorm() - side_squared[1], 2 * d[0].dot(o13), 1};
  // The third quadric minus both: e s_2 s_3 + F s_2 + G s_3 + H = 0.
  Elimination r;
  r.e = -2 * d[1].dot(d[2]);
  r.f = {2 * d[1].dot(o23) - b2[0], -b2[1]};
  r.g = {-2 * d[2].dot(o23) - b3[0], -b3[1]};
  r.h = {o23.squaredNorm() - side_squared[2] - c2[0] - c3[0], -c2[1] - c3[1], -c2[2] - c3[2]};
  const Polynomial<0> e{r.e}, e_squared{r.e * r.e};
  // Insert s_2 into its quadratic: P s_3^2 + Q s_3 + R = 0. Subtract P times the quadratic of s_3: U s_3 + V = 0.
  const Polynomial<2> p = add(add(multiply(r.g, r.g), multiply(multiply(b2, r.g), e), -1), multiply(c2, e_squared));
  const Polynomial<2> gf_he = add(multiply(r.g, r.f), multiply(r.h, e));
  const Polynomial<3> q = add(add(multiply(Polynomial<0>{2}, multiply(r.g, r.h)), multiply(b2, gf_he), -1),
                              multiply(Polynomial<0>{2 * r.e}, multiply(c2, r.f)));
  const Polynomial<4> rest =
      add(add(multiply(r.h, r.h), multiply(b2, multiply(r.h, r.f)), -1), multiply(c2, multiply(r.f, r.f)));
  r.u = add(q, multiply(p, b3), -1);
  r.v = add(rest, multiply(p, c3), -1);
  r.octic = add(add(multiply(r.v, r.v), multiply(b3, multiply(r.u, r.v)), -1), multiply(c3, multiply(r.u, r.u)));
  return r;
}

}  // namespace

Solutions<Pose, 8> solve_gp3p(const Corners& origins, const Corners& directions, const Corners& points) {
  const Eigen::Vector3d sides((points[0] - points[1]).squaredNorm(), (points[0] - points[2]).squaredNorm(),
                              (points[1] - points[2]).squaredNorm());
  const double area = (points[1] - points[0]).cross(points[2] - points[0]).norm();
  if (!(area > kMinTriangleArea * sides.sum())) return {};
  // With three parallel rays the rig can slide along them; rounding alone would decide by how much.
  constexpr double kParallel = 1e-9;
  if (!(std::max(directions[0].cross(directions[1]).norm(), directions[0].cross(directions[2]).norm()) > kParallel))
    return {};
  const double scale = std::sqrt(sides.maxCoeff());  // lengths of about one keep the coefficients comparable
  const double spread = std::max((origins[0] - origins[1]).norm(), (origins[0] - origins[2]).norm());
  Solutions<Pose, 8> poses;
  // All rays come from one centre: the ordinary three-point problem, whose camera centre is that of the rays.
  if (spread < 1e-9 * scale) {
    for (const Pose& camera : solve_p3p(directions, points))
      poses.push_back({camera.rotation, camera.centre - camera.rotation.conjugate() * origins[0]});
    return poses;
  }
  const Corners o = {(origins[0] - origins[0]) / scale, (origins[1] - origins[0]) / scale,
                     (origins[2] - origins[0]) / scale};
  const Eigen::Vector3d side_squared = sides / (scale * scale);
  const Elimination by = eliminate(o, directions, side_squared);
  for (const double first : real_roots(by.octic)) {
    const double third = -evaluate_polynomial(by.v, first) / evaluate_polynomial(by.u, first);
    const double second = -(evaluate_polynomial(by.g, first) * third + evaluate_polynomial(by.h, first)) /
                          (by.e * third + evaluate_polynomial(by.f, first));
    Eigen::Vector3d s(first, second, third);
    if (!s.allFinite() || !polish(o, directions, side_squared, s)) continue;
    if (const auto pose = triangle_pose(corners_at(origins, directions, scale * s), points)) poses.push_back(*pose);
  }
  return poses;
}

}  // namespace megablock
