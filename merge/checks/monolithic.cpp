// With J = | A  B |, A for frames, cameras and mounts and B for the points, B'B has 3 x 3 blocks on its diagonal, and
// the points are eliminated by their inverses:
//
//     (A'A - A'B (B'B)^-1 B'A + G'G) x = A'B (B'B)^-1 B'r - A'r,    G: the rows of the datum, where it is free.
//
// The inverse of this matrix is the covariance of all unknowns except the points. Both are moved to inner constraints
// by S = I - N T, T = (N'WN)^-1 N'W: x to S x, C to S C S' (inner_constraints.h). Here whole matrices are multiplied,
// without the sums over tiles of the merge.
#include "merge/checks/monolithic.h"

#include <ceres/crs_matrix.h>

#include <Eigen/CholmodSupport>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "adjust/tile/ceres_problem.h"
#include "geometry/numbers/decompositions.h"
#include "io/base/error.h"

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

// The rows G that hold the constrained frames along their directions: B of gauge.h, with the diagonal of J'J.
DatumRows datum_rows(const MonolithicSystem& system, const TileProblem& problem, const BlockGauge& gauge) {
  const Eigen::VectorXd root = system.diagonal().unaryExpr([](double d) { return d > 0 ? std::sqrt(d) : 1; });
  std::vector<Eigen::Triplet<double>> entries;
  int rows = 0;
  for (const GaugeConstraint& c : gauge.constraints) {
    const auto row = std::lower_bound(problem.frames.begin(), problem.frames.end(), FrameIndex(c.frame));
    const std::int64_t column = system.frame_column[static_cast<std::size_t>(row - problem.frames.begin())];
    const Eigen::MatrixXd scaled = root.segment<6>(column).asDiagonal() * c.directions.leftCols(c.count);
    const Eigen::MatrixXd basis = orthonormal_basis(scaled);
    for (int k = 0; k < c.count; ++k, ++rows)
      for (int i = 0; i < 6; ++i) entries.emplace_back(rows, column + i, basis(i, k) * root[column + i]);
  }
  DatumRows datum(rows, system.jacobian.cols());
  datum.setFromTriplets(entries.begin(), entries.end());
  return datum;
}

// The S-transformation to inner constraints over the frames: S = I - N T, T = (N'WN)^-1 N'W.
struct InnerTransformation {
  Eigen::MatrixXd n, t;  // [reduced x defect], [defect x reduced]

  Eigen::VectorXd step(const Eigen::VectorXd& x) const { return x - n * (t * x); }
  Eigen::MatrixXd covariance(const Eigen::MatrixXd& c) const {
    const Eigen::MatrixXd left = c - n * (t * c);
    return left - (left * t.transpose()) * n.transpose();
  }
};

InnerTransformation inner_transformation(const MonolithicSystem& system, const TileProblem& problem,
                                         const TileState& state, const BlockGauge& gauge, const TilePlan& plan) {
  InnerTransformation s;
  s.n.setZero(system.reduced_dimension, gauge.defect());
  Eigen::MatrixXd weighted = s.n;
  const std::vector<const BlockComponent*> components = free_component_of_frame(gauge, 0, plan);
  const auto place = [&](std::int64_t column, const BlockComponent& c, const Eigen::MatrixXd& move) {
    s.n.middleRows<6>(column)(Eigen::all, c.columns) = move;
  };
  for (std::size_t f = 0; f < components.size(); ++f) {
    if (components[f] == nullptr) continue;
    const BlockComponent& c = *components[f];
    const std::int64_t column = system.frame_column[f];
    place(column, c, c.move_frame(state.frames[f].centre, reference_place(problem, state, f)));
    weighted.middleRows<6>(column) = c.weights().asDiagonal() * s.n.middleRows<6>(column);
  }
  for (const TileImage& image : problem.images) {  // free mounts move with the scale
    const std::int64_t column = system.mount_column[static_cast<std::size_t>(image.mount)];
    const BlockComponent* c = components[static_cast<std::size_t>(image.frame.value)];
    if (column < 0 || c == nullptr) continue;
    place(column, *c, c->free_part(similarity_of_mount(problem, state, static_cast<std::size_t>(image.mount))));
  }
  s.t = solve_symmetric(weighted.transpose() * s.n, weighted.transpose());
  return s;
}

// The normal equations without the points, sparse, and their right side. `coupling` is B'A, `own` is B'B, and `carried`
// is (B'B)^-1 B'A.
struct ReducedEquations {
  Eigen::SparseMatrix<double> normal;
  Eigen::VectorXd right;
};

ReducedEquations reduced_equations(const MonolithicSystem& system, const DatumRows& datum) {
  using Sparse = Eigen::SparseMatrix<double>;
  const Eigen::Index n = system.reduced_dimension, points = system.jacobian.cols() - n;
  const Sparse poses = system.jacobian.leftCols(n), rays = system.jacobian.rightCols(points);
  const Sparse coupling = rays.transpose() * poses, own = rays.transpose() * rays;
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index p = 0; p < points; p += 3) {
    const Eigen::Matrix3d inverse = Eigen::Matrix3d(Eigen::MatrixXd(own.block(p, p, 3, 3))).inverse();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) entries.emplace_back(p + i, p + j, inverse(i, j));
  }
  Sparse inverse(points, points);
  inverse.setFromTriplets(entries.begin(), entries.end());
  const Sparse carried = inverse * coupling;
  ReducedEquations reduced;
  reduced.normal = poses.transpose() * poses;
  reduced.normal -= Sparse(coupling.transpose() * carried);
  if (datum.rows() > 0) {
    const Sparse rows = datum.leftCols(n);
    reduced.normal += Sparse(rows.transpose() * rows);
  }
  reduced.right = carried.transpose() * (rays.transpose() * system.residual) - poses.transpose() * system.residual;
  return reduced;
}

// The undamped Newton step of all unknowns except the points.
Eigen::VectorXd reduced_step(const MonolithicSystem& system, const DatumRows& datum) {
  const ReducedEquations reduced = reduced_equations(system, datum);
  const Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> solver(reduced.normal);
  if (solver.info() != Eigen::Success) throw ComputeError("monolithic reference: the normal equations are singular");
  Eigen::VectorXd x = solver.solve(reduced.right);
  x += solver.solve(reduced.right - reduced.normal * x);  // one step of iterative refinement
  return x;
}

// The sigmas of the frames that are in the system; zero for the others.
FrameSigmas sigmas_of(const MonolithicSystem& system, const Eigen::MatrixXd& covariance) {
  FrameSigmas sigmas = FrameSigmas::Zero(6, std::ssize(system.frame_column));
  for (std::size_t f = 0; f < system.frame_column.size(); ++f)
    if (const std::int64_t first = system.frame_column[f]; first >= 0)
      sigmas.col(static_cast<Eigen::Index>(f)) = covariance.diagonal().segment<6>(first).cwiseSqrt();
  return sigmas;
}

// The largest ratio of step and sigma. Throws ComputeError when a step is not a number or a sigma is not positive,
// because their ratio would look like agreement.
double largest_over_sigma(const MonolithicSystem& system, const Eigen::VectorXd& step, const FrameSigmas& sigmas) {
  double largest = 0;
  for (std::size_t f = 0; f < system.frame_column.size(); ++f) {
    const std::int64_t first = system.frame_column[f];
    if (first < 0) continue;
    const PoseIncrement own = step.segment<6>(first), sigma = sigmas.col(static_cast<Eigen::Index>(f));
    if (!own.allFinite() || !(sigma.array() > 0).all())
      throw ComputeError("monolithic reference: the step or the sigmas of a frame are not numbers");
    largest = std::max(largest, own.cwiseAbs().cwiseQuotient(sigma).maxCoeff());
  }
  return largest;
}

}  // namespace

Eigen::VectorXd MonolithicSystem::diagonal() const {
  Eigen::VectorXd d(jacobian.cols());
  for (Eigen::Index c = 0; c < jacobian.cols(); ++c) d[c] = jacobian.col(c).squaredNorm();
  return d;
}

// The columns are in the order of the parameter blocks that Ceres is given; the points come last. Residuals carry
// sigmas and losses as Ceres applies them.
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
  Eigen::SparseMatrix<double> normal = system.jacobian.transpose() * system.jacobian;
  normal.diagonal() += lambda * system.diagonal();
  const Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> solver(normal);
  if (solver.info() != Eigen::Success) throw ComputeError("monolithic reference: the normal equations are singular");
  const Eigen::VectorXd b = -system.gradient();
  Eigen::VectorXd x = solver.solve(b);
  x += solver.solve(b - normal * x);  // one step of iterative refinement
  return x;
}

Eigen::MatrixXd monolithic_covariance(const MonolithicSystem& system, const DatumRows& datum) {
  Eigen::MatrixXd reduced = reduced_equations(system, datum).normal;
  // The matrix is scaled to a unit diagonal, because rotations, positions and intrinsics have units of their own.
  const Eigen::VectorXd scale = reduced.diagonal().cwiseMax(0).cwiseSqrt().cwiseInverse();
  reduced = scale.asDiagonal() * reduced * scale.asDiagonal();
  const int size = static_cast<int>(reduced.rows());
  int failed = 0;
  dpotrf_("L", &size, reduced.data(), &size, &failed);
  if (failed == 0) dpotri_("L", &size, reduced.data(), &size, &failed);
  if (failed != 0) throw ComputeError("monolithic reference: the datum of the block is free");
  reduced.triangularView<Eigen::StrictlyUpper>() = reduced.transpose();
  return scale.asDiagonal() * reduced * scale.asDiagonal();
}

double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state) {
  const MonolithicSystem system = monolithic_system(problem, state);
  return largest_over_sigma(system, reduced_step(system, {}), sigmas_of(system, monolithic_covariance(system)));
}

double max_pose_difference_sigmas(const TileProblem& problem, const TileState& state, const BlockGauge& gauge,
                                  const TilePlan& plan, const std::optional<FrameSigmas>& sigmas) {
  const MonolithicSystem system = monolithic_system(problem, state);
  const DatumRows datum = gauge.free() ? datum_rows(system, problem, gauge) : DatumRows();
  Eigen::VectorXd step = reduced_step(system, datum);
  if (!gauge.free())
    return largest_over_sigma(system, step, sigmas ? *sigmas : sigmas_of(system, monolithic_covariance(system)));
  const InnerTransformation inner = inner_transformation(system, problem, state, gauge, plan);
  step = inner.step(step);
  return largest_over_sigma(
      system, step, sigmas ? *sigmas : sigmas_of(system, inner.covariance(monolithic_covariance(system, datum))));
}

}  // namespace megablock
