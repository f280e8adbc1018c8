// Decompositions of small dense matrices. Eigen's templates are compiled here once instead of in every file that needs
// one, which is most of the time a build takes.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <optional>

namespace megablock {

// A = V diag(values) V' of a symmetric matrix (its lower triangle is read); values ascending, vectors in columns.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::Ref<const Eigen::MatrixXd>& a);

// A = U diag(values) V', U and V square; values descending.
struct SingularValues {
  Eigen::VectorXd values;
  Eigen::MatrixXd u, v;
};
SingularValues singular_values(const Eigen::Ref<const Eigen::MatrixXd>& a);

// Orthonormal basis of the columns of A [n x k], k <= n, which must be independent.
Eigen::MatrixXd orthonormal_basis(const Eigen::Ref<const Eigen::MatrixXd>& a);

// A^-1 of a regular matrix; A^-1 B of a symmetric definite one.
Eigen::MatrixXd inverse(const Eigen::Ref<const Eigen::MatrixXd>& a);
Eigen::MatrixXd solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::Ref<const Eigen::MatrixXd>& b);

// The same of three rows and columns, for kernels: nothing is allocated.
struct SymmetricEigen3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d vectors;
};
SymmetricEigen3 symmetric_eigen3(const Eigen::Matrix3d& a);
struct SingularValues3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d u, v;
};
SingularValues3 singular_values3(const Eigen::Matrix3d& a);
Eigen::Vector3d solve_symmetric3(const Eigen::Matrix3d& a, const Eigen::Vector3d& b);

// Matrices of minimal solvers: up to 12 x 12, held in place, as solvers must not allocate.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 12, 12>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 12, 1>;

// Of a square matrix: A V = U diag(values), values descending.
struct RightSingularVectors {
  SmallVector values;
  SmallMatrix v;
};
RightSingularVectors right_singular_vectors(const SmallMatrix& a);

// A v = value v of a square matrix; empty where the iteration does not end.
struct GeneralEigen {
  Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 1, Eigen::ColMajor, 12, 1> values;
  Eigen::Matrix<std::complex<double>, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 12, 12> vectors;
};
std::optional<GeneralEigen> general_eigen(const SmallMatrix& a);

// Up to seven vectors of nine dimensions.
using NineRows = Eigen::Matrix<double, 9, Eigen::Dynamic, Eigen::ColMajor, 9, 7>;

// A P = Q R [9 x n], the column of largest rest first: Q times vectors whose first n rows are zero is perpendicular to
// the columns of A.
struct PivotedQr {
  NineRows q_times;
  double largest, smallest;  // of the diagonal of R, absolute
};
PivotedQr pivoted_qr(const NineRows& a, const NineRows& vectors);

}  // namespace megablock
