#include "merge/monolithic.h"

#include <ceres/crs_matrix.h>

#include <Eigen/CholmodSupport>
#include <Eigen/Dense>
#include <cmath>
#include <map>

#include "adjust/ceres_problem.h"
#include "io/error.h"

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dpotri_(const char* uplo, const int* n, double* a, const int* lda, int* info);
}

namespace megablock {

namespace {

Eigen::SparseMatrix<double> to_eigen(ceres::CRSMatrix& m) {
  using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(m.num_rows, m.num_cols, static_cast<int>(m.values.size()), m.rows.data(),
                                    m.cols.data(), m.values.data());
}

Eigen::SparseMatrix<double> normal_matrix(const MonolithicSystem& system) {
  return Eigen::SparseMatrix<double>(system.jacobian.transpose() * system.jacobian);
}

}  // namespace

Eigen::VectorXd MonolithicSystem::diagonal() const {
  Eigen::VectorXd d(jacobian.cols());
  for (Eigen::Index c = 0; c < jacobian.cols(); ++c) d[c] = jacobian.col(c).squaredNorm();
  return d;
}

MonolithicSystem monolithic_system(const TileProblem& problem, const TileState& state) {
  CeresTile tile(problem, state);
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = tile.unknown_blocks();
  options.num_threads = 1;
  std::map<double*, std::int64_t> column;
  std::int64_t next = 0;
  for (double* block : options.parameter_blocks) {
    column[block] = next;
    next += tile.problem().ParameterBlockTangentSize(block);
  }
  const auto column_of = [&](double* block) {
    const auto entry = column.find(block);
    return entry == column.end() ? -1 : entry->second;
  };

  MonolithicSystem system;
  system.reduced_dimension = next;
  for (std::size_t row = 0; row < problem.frames.size(); ++row)
    system.frame_column.push_back(column_of(tile.frame(static_cast<std::int64_t>(row))));
  for (std::size_t row = 0; row < problem.cameras.size(); ++row)
    system.camera_column.push_back(column_of(tile.camera(static_cast<std::int64_t>(row))));
  for (std::size_t row = 0; row < problem.mounts.size(); ++row)
    system.mount_column.push_back(column_of(tile.mount(static_cast<std::int64_t>(row))));
  for (std::size_t row = 0; row < problem.points.size(); ++row) {
    system.point_column.push_back(column_of(tile.point(static_cast<std::int64_t>(row))));
    if (system.point_column.back() >= 0)
      system.reduced_dimension = std::min(system.reduced_dimension, system.point_column.back());
  }

  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  if (!tile.problem().Evaluate(options, &system.cost, &residuals, nullptr, &jacobian))
    throw ComputeError("monolithic reference: Ceres cannot evaluate the block");
  system.residual = Eigen::Map<const Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
  system.jacobian = to_eigen(jacobian);
  return system;
}

Eigen::VectorXd monolithic_step(const MonolithicSystem& system, double lambda) {
  Eigen::SparseMatrix<double> normal = normal_matrix(system);
  normal.diagonal() += lambda * system.diagonal();
  const Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> solver(normal);
  if (solver.info() != Eigen::Success) throw ComputeError("monolithic reference: the normal equations are singular");
  const Eigen::VectorXd b = -system.gradient();
  Eigen::VectorXd x = solver.solve(b);
  x += solver.solve(b - normal * x);  // one step of iterative refinement
  return x;
}

Eigen::MatrixXd monolithic_covariance(const MonolithicSystem& system) {
  const Eigen::Index n = system.reduced_dimension, points = system.jacobian.cols() - n;
  const Eigen::SparseMatrix<double> normal = normal_matrix(system);
  Eigen::MatrixXd reduced = Eigen::MatrixXd(normal.topLeftCorner(n, n));
  const Eigen::SparseMatrix<double> coupling = normal.bottomLeftCorner(points, n);  // [points x n]
  const Eigen::SparseMatrix<double> own = normal.bottomRightCorner(points, points);
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index p = 0; p < points; p += 3) {
    const Eigen::Matrix3d inverse = Eigen::MatrixXd(own.block(p, p, 3, 3)).inverse();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) entries.emplace_back(p + i, p + j, inverse(i, j));
  }
  Eigen::SparseMatrix<double> inverse(points, points);
  inverse.setFromTriplets(entries.begin(), entries.end());
  reduced -= Eigen::MatrixXd(Eigen::SparseMatrix<double>(coupling.transpose() * inverse * coupling));

  const Eigen::VectorXd scale = reduced.diagonal().cwiseMax(0).cwiseSqrt().cwiseInverse();
  reduced = scale.asDiagonal() * reduced * scale.asDiagonal();
  const int size = static_cast<int>(n);
  int failed = 0;
  dpotrf_("L", &size, reduced.data(), &size, &failed);
  if (failed == 0) dpotri_("L", &size, reduced.data(), &size, &failed);
  if (failed != 0) throw ComputeError("monolithic reference: the datum of the block is free");
  reduced.triangularView<Eigen::StrictlyUpper>() = reduced.transpose();
  return scale.asDiagonal() * reduced * scale.asDiagonal();
}

double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state) {
  const MonolithicSystem system = monolithic_system(problem, state);
  const Eigen::VectorXd step = monolithic_step(system, 0);
  const Eigen::MatrixXd covariance = monolithic_covariance(system);
  double largest = 0;
  for (std::int64_t first : system.frame_column)
    for (std::int64_t k = first; first >= 0 && k < first + 6; ++k)
      largest = std::max(largest, std::abs(step[k]) / std::sqrt(covariance(k, k)));
  return largest;
}

}  // namespace megablock
