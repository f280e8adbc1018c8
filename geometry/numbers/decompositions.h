// Decomposes small dense matrices: eigenvalues, singular values, QR, inverse and solution of normal equations.
//
// Eigen's decompositions are templates, and to compile them takes most of the time of a build. This file compiles each
// of them once; all other files call these functions instead.
//
// None of the functions checks its input: a matrix with values that are not finite gives values that are not finite.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <optional>

namespace megablock {

// Eigenvalues and eigenvectors of a symmetric matrix, A = V diag(values) V'. Only the lower triangle of A is read. The
// values ascend; column i of `vectors` belongs to value i.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::Ref<const Eigen::MatrixXd>& a);

// Singular values of a matrix of any shape, A = U diag(values) V'. U and V are square and orthogonal; the values
// descend.
struct SingularValues {
  Eigen::VectorXd values;
  Eigen::MatrixXd u, v;
};
SingularValues singular_values(const Eigen::Ref<const Eigen::MatrixXd>& a);

// Returns an orthonormal basis [n x k] of the space that the columns of A [n x k] span; k <= n. The columns must be
// linearly independent.
Eigen::MatrixXd orthonormal_basis(const Eigen::Ref<const Eigen::MatrixXd>& a);

// inverse() returns A^-1 of a regular square matrix. solve_symmetric() returns A^-1 B, where A is symmetric and
// positive (or negative) definite, by the factorisation L D L'.
Eigen::MatrixXd inverse(const Eigen::Ref<const Eigen::MatrixXd>& a);
Eigen::MatrixXd solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::Ref<const Eigen::MatrixXd>& b);

// The same for 3 x 3 matrices. These versions allocate no memory, so inner loops may call them.
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

// Matrices of minimal solvers, up to 12 x 12. They are held in place, because a solver runs millions of times in RANSAC
// and must not allocate memory.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 12, 12>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 12, 1>;

// Singular values (descending) and right singular vectors (columns of v) of a square matrix. The last column spans the
// null space of a matrix of rank n - 1.
struct RightSingularVectors {
  SmallVector values;
  SmallMatrix v;
};
RightSingularVectors right_singular_vectors(const SmallMatrix& a);

// Eigenvalues and eigenvectors of a general square matrix, A v = value v, both complex. general_eigen() returns an
// empty optional where the QR iteration does not converge.
struct GeneralEigen {
  Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 1, Eigen::ColMajor, 12, 1> values;
  Eigen::Matrix<std::complex<double>, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 12, 12> vectors;
};
std::optional<GeneralEigen> general_eigen(const SmallMatrix& a);

// Up to seven vectors of nine dimensions: the rows of the linear systems for an essential matrix or a homography,
// transposed.
using NineRows = Eigen::Matrix<double, 9, Eigen::Dynamic, Eigen::ColMajor, 9, 7>;

// QR factorisation with column pivoting, A P = Q R with A [9 x n]. The pivoting takes the column with the largest
// remainder first. pivoted_qr() returns Q times `vectors`. Vectors whose first n elements are zero become vectors
// perpendicular to all columns of A; in this way a solver gets a basis of a null space without a singular value
// decomposition.
struct PivotedQr {
  NineRows q_times;
  double largest, smallest;  // absolute values on the diagonal of R; their ratio tells the rank
};
PivotedQr pivoted_qr(const NineRows& a, const NineRows& vectors);

}  // namespace megablock
