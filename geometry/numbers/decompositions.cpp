#include "geometry/numbers/decompositions.h"

#include <Eigen/Dense>
#include <cmath>

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

SymmetricEigen3 symmetric_eigen3(const Eigen::Matrix3d& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(a);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SingularValues3 singular_values3(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
}

Eigen::Vector3d solve_symmetric3(const Eigen::Matrix3d& a, const Eigen::Vector3d& b) { return a.ldlt().solve(b); }

RightSingularVectors right_singular_vectors(const SmallMatrix& a) {
  const Eigen::JacobiSVD<SmallMatrix, Eigen::NoQRPreconditioner> svd(a, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

std::optional<GeneralEigen> general_eigen(const SmallMatrix& a) {
  const Eigen::EigenSolver<SmallMatrix> solver(a);
  if (solver.info() != Eigen::Success) return std::nullopt;
  return GeneralEigen{solver.eigenvalues(), solver.eigenvectors()};
}

PivotedQr pivoted_qr(const NineRows& a, const NineRows& vectors) {
  const Eigen::ColPivHouseholderQR<NineRows> qr(a);
  const NineRows& factors = qr.matrixQR();
  const Eigen::Index last = a.cols() - 1;
  PivotedQr result{vectors, std::abs(factors(0, 0)), std::abs(factors(last, last))};
  // Q is the product of the Householder reflections H_0 H_1 ... They are applied one by one, last first. Eigen's own
  // product groups reflections into blocks, which is meant for large matrices and instantiates much more code.
  Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, 7> workspace(vectors.cols());
  for (Eigen::Index k = last; k >= 0; --k)
    result.q_times.bottomRows(9 - k).applyHouseholderOnTheLeft(factors.col(k).tail(8 - k), qr.hCoeffs()(k),
                                                               workspace.data());
  return result;
}

}  // namespace megablock
