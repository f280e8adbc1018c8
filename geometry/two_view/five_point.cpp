#include "geometry/two_view/five_point.h"

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <limits>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/polynomial.h"

namespace megablock {

namespace {

// Polynomials in x, y, z as vectors of coefficients: of degree 1 (x, y, z, 1), of degree 2 (x2, xy, y2, xz, yz, z2, x,
// y, z, 1) and of degree 3 (in the order of the elimination, see add_product).
using LinearForm = Eigen::Matrix<double, 1, 4>;
using QuadraticForm = Eigen::Matrix<double, 1, 10>;
using CubicForm = Eigen::Matrix<double, 1, 20>;

QuadraticForm product(const LinearForm& p, const LinearForm& q) {
  QuadraticForm r;
  r << p[0] * q[0], p[0] * q[1] + p[1] * q[0], p[1] * q[1], p[0] * q[2] + p[2] * q[0], p[1] * q[2] + p[2] * q[1],
      p[2] * q[2], p[0] * q[3] + p[3] * q[0], p[1] * q[3] + p[3] * q[1], p[2] * q[3] + p[3] * q[2], p[3] * q[3];
  return r;
}

// Adds p q to r. Order of a cubic: x3, y3, x2y, xy2, x2z, x2, y2z, y2, xyz, xy, xz2, xz, x, yz2, yz, y, z3, z2, z, 1.
void add_product(const QuadraticForm& p, const LinearForm& q, CubicForm& r) {
  r[0] += p[0] * q[0];
  r[1] += p[2] * q[1];
  r[2] += p[0] * q[1] + p[1] * q[0];
  r[3] += p[1] * q[1] + p[2] * q[0];
  r[4] += p[0] * q[2] + p[3] * q[0];
  r[5] += p[0] * q[3] + p[6] * q[0];
  r[6] += p[2] * q[2] + p[4] * q[1];
  r[7] += p[2] * q[3] + p[7] * q[1];
  r[8] += p[1] * q[2] + p[3] * q[1] + p[4] * q[0];
  r[9] += p[1] * q[3] + p[6] * q[1] + p[7] * q[0];
  r[10] += p[3] * q[2] + p[5] * q[0];
  r[11] += p[3] * q[3] + p[6] * q[2] + p[8] * q[0];
  r[12] += p[6] * q[3] + p[9] * q[0];
  r[13] += p[4] * q[2] + p[5] * q[1];
  r[14] += p[4] * q[3] + p[7] * q[2] + p[8] * q[1];
  r[15] += p[7] * q[3] + p[9] * q[1];
  r[16] += p[5] * q[2];
  r[17] += p[5] * q[3] + p[8] * q[2];
  r[18] += p[8] * q[3] + p[9] * q[2];
  r[19] += p[9] * q[3];
}

using CoplanarityBasis = Eigen::Matrix<double, 9, 4>;  // E1 to E4, each by rows

// Basis of the matrices E with b_i' E a_i = 0 for the five pairs. Returns false where the equations are not
// independent.
bool coplanarity_basis(const FiveRays& a, const FiveRays& b, CoplanarityBasis& basis) {
  NineRows equations(9, 5), vectors = NineRows::Zero(9, 4);
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d &p = a[static_cast<std::size_t>(i)], &q = b[static_cast<std::size_t>(i)];
    for (int r = 0; r < 3; ++r) equations.block<3, 1>(3 * r, i) = q[r] * p;
  }
  // A rotation in four dimensions mixes the basis. Its numbers are arbitrary, so that no structured scene has a
  // solution at infinity.
  const Eigen::Vector4d q = Eigen::Vector4d(0.3127, 0.4891, 0.6533, 0.4172).normalized();
  vectors.bottomRows<4>() << q[0], q[1], q[2], q[3], -q[1], q[0], -q[3], q[2], -q[2], q[3], q[0], -q[1], -q[3], -q[2],
      q[1], q[0];
  const PivotedQr qr = pivoted_qr(equations, vectors);
  basis = qr.q_times;
  return qr.smallest > 1e-12;
}

// Tolerance for double roots, which the rounding of the elimination perturbs. Polishing rejects the roots that are not
// real solutions.
constexpr double kMultipleRoot = 1e-4, kComplexPair = 0.01;
// Largest coefficient of the reduced system (against one) for which the determinant keeps enough digits.
constexpr double kWellReduced = 1000;

using ConstraintSystem = Eigen::Matrix<double, 10, 20, Eigen::RowMajor>;
using LeadingBlock = Eigen::Matrix<double, 10, 10>;

// The ten cubics: nine elements of 2 E E' E - tr(E E') E = 0 (divided by two), and det E = 0.
ConstraintSystem essential_constraints(const CoplanarityBasis& basis) {
  const auto entry = [&](int r, int c) -> LinearForm { return basis.row(3 * r + c); };
  // E E' - tr(E E') / 2.
  std::array<std::array<QuadraticForm, 3>, 3> g;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = i; j < 3; ++j) {
      const int r = static_cast<int>(i), s = static_cast<int>(j);
      g[i][j] =
          product(entry(r, 0), entry(s, 0)) + product(entry(r, 1), entry(s, 1)) + product(entry(r, 2), entry(s, 2));
      g[j][i] = g[i][j];
    }
  }
  const QuadraticForm half_trace = 0.5 * (g[0][0] + g[1][1] + g[2][2]);
  for (std::size_t i = 0; i < 3; ++i) g[i][i] -= half_trace;
  ConstraintSystem system;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      CubicForm row = CubicForm::Zero();
      for (int k = 0; k < 3; ++k)
        add_product(g[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)], entry(k, j), row);
      system.row(3 * i + j) = row;
    }
  }
  CubicForm determinant = CubicForm::Zero();
  for (int j = 0; j < 3; ++j) {
    const int k = (j + 1) % 3, l = (j + 2) % 3;
    add_product(product(entry(1, k), entry(2, l)) - product(entry(1, l), entry(2, k)), entry(0, j), determinant);
  }
  system.row(9) = determinant;
  return system;
}

// Rows x2z, x2, y2z, y2, xyz, xy of the system after the elimination; columns: their coefficients of xz2, xz, x, yz2,
// yz, y, z3, z2, z, 1.
Eigen::Matrix<double, 6, 10> reduced_rows(const ConstraintSystem& system) {
  const Eigen::PartialPivLU<LeadingBlock> lu(LeadingBlock(system.leftCols<10>()));
  return lu.solve(LeadingBlock(system.rightCols<10>())).bottomRows<6>();
}

// One of the three equations that are linear in x and y; their coefficients are polynomials in z.
struct LinearInXy {
  Polynomial<3> x, y;
  Polynomial<4> one;
};

// The row of a monomial times z (`upper`) minus z times the row of the monomial (`lower`).
LinearInXy equation_from(const Eigen::Matrix<double, 1, 10>& upper, const Eigen::Matrix<double, 1, 10>& lower) {
  return {{upper[2], upper[1] - lower[2], upper[0] - lower[1], -lower[0]},
          {upper[5], upper[4] - lower[5], upper[3] - lower[4], -lower[3]},
          {upper[9], upper[8] - lower[9], upper[7] - lower[8], upper[6] - lower[7], -lower[6]}};
}

constexpr double kSolved = 1e-10;  // limit for the sines of the angles between rays and epipolar planes

// Newton's iteration on b' [t]x R a = 0, five equations in rotation and base. Returns false where it does not converge
// to a solution. One step is enough for a simple root. Towards a double root (the base along the normal of a plane)
// each step only halves the distance and leaves a quarter of the residuals. Where the last step did so, the next is
// taken twice as long, which restores quadratic convergence.
bool polish_orientation(const FiveRays& a, const FiveRays& b, RelativeOrientation& o) {
  const auto residuals = [&](const RelativeOrientation& at) {
    const Eigen::Matrix3d essential = essential_from(at);
    Eigen::Matrix<double, 5, 1> r;
    for (int i = 0; i < 5; ++i) r[i] = b[static_cast<std::size_t>(i)].dot(essential * a[static_cast<std::size_t>(i)]);
    return r;
  };
  Eigen::Matrix<double, 5, 1> r = residuals(o);
  double before = std::numeric_limits<double>::infinity();  // sum of squares
  for (int iteration = 0; iteration < 25; ++iteration) {
    if (r.squaredNorm() < 1e-30) return true;
    const Eigen::Matrix3d rotation = o.rotation.toRotationMatrix();
    const Eigen::Vector3d first = o.base.unitOrthogonal(), second = o.base.cross(first);
    Eigen::Matrix<double, 5, 5> jacobian;
    for (int i = 0; i < 5; ++i) {
      // Residual b . (t x R a); its derivatives are -(b x t)' R [a]x by the rotation and (R a x b)' by the base.
      const Eigen::Vector3d &p = a[static_cast<std::size_t>(i)], &q = b[static_cast<std::size_t>(i)];
      const Eigen::Vector3d normal = (rotation * p).cross(q);
      jacobian.block<1, 3>(i, 0) = p.cross(rotation.transpose() * q.cross(o.base)).transpose();
      jacobian(i, 3) = normal.dot(first);
      jacobian(i, 4) = normal.dot(second);
    }
    Eigen::Matrix<double, 5, 1> step = jacobian.partialPivLu().solve(r);
    const double share = r.squaredNorm() / before;
    if (share > 1.0 / 32 && share < 1.0 / 8) step *= 2;
    before = r.squaredNorm();
    const double length = step.norm();
    if (!std::isfinite(length)) break;
    if (length > 0.1) step *= 0.1 / length;
    bool improved = false;
    for (int halving = 0; halving < 4 && !improved; ++halving, step *= 0.5) {
      const RelativeOrientation next{rotation_update(o.rotation, -step.head<3>()),
                                     (o.base - step[3] * first - step[4] * second).normalized()};
      const Eigen::Matrix<double, 5, 1> there = residuals(next);
      improved = there.squaredNorm() < r.squaredNorm();
      if (!improved) continue;
      o = next;
      r = there;
    }
    if (!improved) break;
  }
  return r.squaredNorm() < kSolved * kSolved;
}

using EssentialCoefficients = Solutions<Eigen::Vector4d, 10>;  // (x, y, z, 1) up to scale

// The essential matrices by the determinant of degree ten, the fast way.
EssentialCoefficients by_determinant(const Eigen::Matrix<double, 6, 10>& rows) {
  EssentialCoefficients found;
  const LinearInXy k = equation_from(rows.row(0), rows.row(1)), l = equation_from(rows.row(2), rows.row(3)),
                   m = equation_from(rows.row(4), rows.row(5));
  const auto minor = [](const Polynomial<3>& p, const Polynomial<3>& q, const Polynomial<3>& r,
                        const Polynomial<3>& s) { return add(multiply(p, s), multiply(q, r), -1); };
  const Polynomial<10> determinant =
      add(add(multiply(minor(k.x, k.y, l.x, l.y), m.one), multiply(minor(m.x, m.y, k.x, k.y), l.one)),
          multiply(minor(l.x, l.y, m.x, m.y), k.one));
  for (const ProjectiveRoot& root : projective_roots(determinant, kMultipleRoot)) {
    if (!(root.denominator > 1e-12)) continue;
    const double z = root.numerator / root.denominator;
    // (x, y, 1) is perpendicular to the coefficients of all three equations. The longest cross product of two is the
    // most accurate.
    std::array<Eigen::Vector3d, 3> e;
    for (std::size_t i = 0; i < 3; ++i) {
      const LinearInXy& equation = i == 0 ? k : i == 1 ? l : m;
      e[i] = Eigen::Vector3d(evaluate_polynomial(equation.x, z), evaluate_polynomial(equation.y, z),
                             evaluate_polynomial(equation.one, z))
                 .normalized();
    }
    Eigen::Vector3d solution = e[0].cross(e[1]);
    for (const Eigen::Vector3d& other : {Eigen::Vector3d(e[1].cross(e[2])), Eigen::Vector3d(e[2].cross(e[0]))})
      if (other.squaredNorm() > solution.squaredNorm()) solution = other;
    found.push_back({solution.x(), solution.y(), z * solution.z(), solution.z()});
  }
  return found;
}

// The essential matrices by eigenvectors. All cubic monomials are reduced to the basis x2, xy, y2, xz, yz, z2, x, y, z,
// 1; multiplication by z is then a 10 x 10 matrix, whose eigenvectors are the values of the basis at the solutions.
EssentialCoefficients by_eigenvectors(const ConstraintSystem& system) {
  // Columns of the cubic monomials x3, x2y, xy2, y3, x2z, xyz, y2z, xz2, yz2, z3 and of the basis in the system.
  static constexpr std::array<int, 10> kCubic = {0, 2, 3, 1, 4, 8, 6, 10, 13, 16},
                                       kRest = {5, 9, 7, 11, 14, 17, 12, 15, 18, 19};
  LeadingBlock cubic, rest;
  for (int i = 0; i < 10; ++i) {
    cubic.col(i) = system.col(kCubic[static_cast<std::size_t>(i)]);
    rest.col(i) = system.col(kRest[static_cast<std::size_t>(i)]);
  }
  const LeadingBlock reduced = cubic.partialPivLu().solve(rest);
  EssentialCoefficients found;
  if (!reduced.allFinite()) return found;
  LeadingBlock times_z = LeadingBlock::Zero();
  times_z.topRows<6>() = -reduced.bottomRows<6>();
  times_z(6, 3) = times_z(7, 4) = times_z(8, 5) = times_z(9, 8) = 1;
  const std::optional<GeneralEigen> eigen = general_eigen(times_z);
  if (!eigen) return found;
  for (int i = 0; i < 10; ++i) {
    // Rounding may turn a double root into a complex pair. The real part is a start that polishing brings to the
    // solution.
    const std::complex<double> value = eigen->values[i];
    if (!(std::abs(value.imag()) <= kComplexPair * std::abs(value)) || value.imag() < 0) continue;
    found.push_back(eigen->vectors.col(i).tail<4>().real());
  }
  return found;
}

// One polished orientation for each real essential matrix.
Solutions<RelativeOrientation, 10> one_of_each(const FiveRays& a, const FiveRays& b) {
  Solutions<RelativeOrientation, 10> found;
  CoplanarityBasis basis;
  if (!coplanarity_basis(a, b, basis)) return found;
  const ConstraintSystem system = essential_constraints(basis);
  const Eigen::Matrix<double, 6, 10> rows = reduced_rows(system);
  const bool well_reduced = rows.cwiseAbs().maxCoeff() < kWellReduced;
  for (const Eigen::Vector4d& solution : well_reduced ? by_determinant(rows) : by_eigenvectors(system)) {
    const Eigen::Matrix<double, 9, 1> entries = basis * solution;
    Eigen::Matrix3d essential;
    essential << entries.head<3>().transpose(), entries.segment<3>(3).transpose(), entries.tail<3>().transpose();
    const auto orientations = orientations_of_essential(essential);
    if (orientations.empty()) continue;
    RelativeOrientation polished = orientations.front();
    if (polish_orientation(a, b, polished)) found.push_back(polished);
  }
  return found;
}

// The other rotation of the same essential matrix: turned by 180 degrees about the base.
RelativeOrientation twin_of(const RelativeOrientation& o) {
  return {Eigen::Quaterniond(0, o.base.x(), o.base.y(), o.base.z()) * o.rotation, o.base};
}

}  // namespace

Solutions<RelativeOrientation, 40> solve_five_point(const FiveRays& a, const FiveRays& b) {
  Solutions<RelativeOrientation, 40> found;
  for (const RelativeOrientation& one : one_of_each(a, b)) {
    for (const RelativeOrientation& o : {one, twin_of(one)}) {
      found.push_back(o);
      found.push_back({o.rotation, -o.base});
    }
  }
  return found;
}

Solutions<RelativeOrientation, 10> solve_five_point_in_front(const FiveRays& a, const FiveRays& b) {
  Solutions<RelativeOrientation, 10> found;
  for (const RelativeOrientation& one : one_of_each(a, b)) {
    for (const RelativeOrientation& o : {one, twin_of(one)}) {
      for (const RelativeOrientation& candidate : {o, RelativeOrientation{o.rotation, -o.base}})
        if (all_in_front(candidate, a, b)) found.push_back(candidate);
    }
  }
  return found;
}

}  // namespace megablock
