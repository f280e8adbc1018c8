// Decompositions of small dense matrices of any size. Eigen's templates are compiled here once instead of in every file
// that needs one; kernels that run per observation use Eigen's fixed sizes instead.
#pragma once

#include <Eigen/Core>

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

}  // namespace megablock
