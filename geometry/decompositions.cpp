#include "geometry/decompositions.h"

#include <Eigen/Dense>

namespace megablock {

SymmetricEigen symmetric_eigen(const Eigen::Ref<const Eigen::MatrixXd>& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SingularValues singular_values(const Eigen::Ref<const Eigen::MatrixXd>& a) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
}

Eigen::MatrixXd orthonormal_basis(const Eigen::Ref<const Eigen::MatrixXd>& a) {
  return a.householderQr().householderQ() * Eigen::MatrixXd::Identity(a.rows(), a.cols());
}

Eigen::MatrixXd inverse(const Eigen::Ref<const Eigen::MatrixXd>& a) { return a.inverse(); }

Eigen::MatrixXd solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& a,
                                const Eigen::Ref<const Eigen::MatrixXd>& b) {
  return a.ldlt().solve(b);
}

}  // namespace megablock
