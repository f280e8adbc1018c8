#include "geometry/two_view/fundamental.h"

#include <Eigen/LU>
#include <cmath>

#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/polynomial.h"
#include "geometry/numbers/row_qr.h"
#include "geometry/two_view/relative_orientation.h"

namespace megablock {

namespace {

// Relative size below which a singular value of the equations counts as zero.
constexpr double kRankTolerance = 1e-9;

// Coefficients of the elements of F, by rows, in b' F a.
Eigen::Matrix<double, 1, 9> epipolar_row(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix<double, 1, 9> row;
  row << b.x() * a.transpose(), b.y() * a.transpose(), b.z() * a.transpose();
  return row;
}

Eigen::Matrix3d matrix_from_rows(const Eigen::Matrix<double, 9, 1>& v) {
  Eigen::Matrix3d m;
  m << v.head<3>().transpose(), v.segment<3>(3).transpose(), v.tail<3>().transpose();
  return m;
}

}  // namespace

std::optional<Eigen::Matrix3d> normalising_transformation(std::span<const Eigen::Vector2d> points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  // The scale brings the mean distance from the centroid to sqrt(2), which makes all elements of the equations of order
  // one.
  double distance = 0;
  for (const Eigen::Vector2d& p : points) distance += (p - mean).norm();
  const double scale = std::sqrt(2.0) * static_cast<double>(points.size()) / distance;
  if (!(distance > 0) || !std::isfinite(scale)) return std::nullopt;
  Eigen::Matrix3d t;
  t << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return t;
}

Solutions<Eigen::Matrix3d, 3> solve_seven_point(const std::array<Eigen::Vector2d, 7>& a,
                                                const std::array<Eigen::Vector2d, 7>& b) {
  Solutions<Eigen::Matrix3d, 3> found;
  const auto normal_a = normalising_transformation(a), normal_b = normalising_transformation(b);
  if (!normal_a || !normal_b) return found;
  NineRows equations(9, 7), vectors = NineRows::Zero(9, 2);
  for (int i = 0; i < 7; ++i)
    equations.col(i) = epipolar_row(*normal_a * a[static_cast<std::size_t>(i)].homogeneous(),
                                    *normal_b * b[static_cast<std::size_t>(i)].homogeneous())
                           .transpose();
  // An arbitrary rotation, so that no structured scene has its solution at infinity.
  vectors.bottomRows<2>() << 0.8, 0.6, -0.6, 0.8;
  const PivotedQr qr = pivoted_qr(equations, vectors);
  if (!(qr.smallest > kRankTolerance * qr.largest)) return found;
  const Eigen::Matrix3d f1 = matrix_from_rows(qr.q_times.col(0)), f2 = matrix_from_rows(qr.q_times.col(1));
  // The coefficients of det(F1 + s F2); the middle ones come from the cofactors.
  const Polynomial<3> cubic = {f1.determinant(), cofactors(f1).cwiseProduct(f2).sum(),
                               cofactors(f2).cwiseProduct(f1).sum(), f2.determinant()};
  for (const ProjectiveRoot& root : projective_roots(cubic)) {
    const Eigen::Matrix3d f = normal_b->transpose() * (root.denominator * f1 + root.numerator * f2) * *normal_a;
    found.push_back(f / f.norm());
  }
  return found;
}

std::optional<Eigen::Matrix3d> fit_fundamental(std::span<const Eigen::Vector2d> a, std::span<const Eigen::Vector2d> b) {
  if (a.size() < 8 || a.size() != b.size()) return std::nullopt;
  const auto normal_a = normalising_transformation(a), normal_b = normalising_transformation(b);
  if (!normal_a || !normal_b) return std::nullopt;
  RowQr<9> equations;
  for (std::size_t i = 0; i < a.size(); ++i)
    equations.add(epipolar_row(*normal_a * a[i].homogeneous(), *normal_b * b[i].homogeneous()));
  const auto null = equations.null_vector(kRankTolerance);
  if (null.rank < 8) return std::nullopt;
  const SingularValues3 svd = singular_values3(matrix_from_rows(null.vector));
  // The nearest matrix of rank two in the Frobenius norm.
  Eigen::Vector3d values = svd.values;
  values.z() = 0;
  const Eigen::Matrix3d f = normal_b->transpose() * (svd.u * values.asDiagonal() * svd.v.transpose()) * *normal_a;
  return f / f.norm();
}

std::optional<Eigen::Matrix3d> fit_essential(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b) {
  if (a.size() < 8 || a.size() != b.size()) return std::nullopt;
  RowQr<9> equations;
  for (std::size_t i = 0; i < a.size(); ++i) equations.add(epipolar_row(a[i], b[i]));
  const auto null = equations.null_vector(kRankTolerance);
  if (null.rank < 8) return std::nullopt;
  return nearest_essential(matrix_from_rows(null.vector));
}

}  // namespace megablock
