// With u = (X - C - o) / |X - C - o|, where o is the arm of the camera in its frame (ground axes), the residual of an
// observation is (v - u) / sigma, and
//
//     by C:  (I - u u') / (|X - C - o| sigma),   by X: the negative of it.
//
// Points are eliminated first, as in adjust/tile/solve.cpp.
#include "adjust/orientation/steps/global_positioning.h"

#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

namespace megablock {

namespace {

using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// v - (X - C - offset) / |X - C - offset|, over sigma; blocks C and X.
class DirectionResidual : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  DirectionResidual(const Eigen::Vector3d& ray, const Eigen::Vector3d& offset, double inverse_sigma)
      : ray_(ray), offset_(offset), inverse_sigma_(inverse_sigma) {}

  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    const Eigen::Vector3d difference =
        Eigen::Map<const Eigen::Vector3d>(blocks[1]) - Eigen::Map<const Eigen::Vector3d>(blocks[0]) - offset_;
    const double distance = difference.norm();
    if (!(distance > 0)) return false;
    const Eigen::Vector3d unit = difference / distance;
    Eigen::Map<Eigen::Vector3d>(residual, 3) = inverse_sigma_ * (ray_ - unit);
    if (jacobians == nullptr) return true;
    const Eigen::Matrix3d by_centre =
        inverse_sigma_ / distance * (Eigen::Matrix3d::Identity() - unit * unit.transpose());
    if (jacobians[0]) Eigen::Map<RowMatrix3>(jacobians[0], 3, 3) = by_centre;
    if (jacobians[1]) Eigen::Map<RowMatrix3>(jacobians[1], 3, 3) = -by_centre;
    return true;
  }

 private:
  Eigen::Vector3d ray_, offset_;  // offset: of the camera from its frame, ground axes
  double inverse_sigma_;
};

// (C - P) / sigma.
class StatedPosition : public ceres::SizedCostFunction<3, 3> {
 public:
  StatedPosition(const Eigen::Vector3d& position, const Eigen::Vector3d& sigma)
      : position_(position), weight_(sigma.cwiseInverse()) {}

  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    Eigen::Map<Eigen::Vector3d>(residual, 3) =
        weight_.cwiseProduct(Eigen::Map<const Eigen::Vector3d>(blocks[0]) - position_);
    if (jacobians && jacobians[0]) Eigen::Map<RowMatrix3>(jacobians[0], 3, 3) = weight_.asDiagonal();
    return true;
  }

 private:
  Eigen::Vector3d position_, weight_;
};

}  // namespace

void position_globally(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                       const PositioningOptions& options, OrientationValues& values) {
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  // The scales are in sigmas, of rays and of positions.
  ceres::CauchyLoss ray_loss(2.0), position_loss(3.0);
  ceres::Problem problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();

  for (std::size_t t = 0; t < values.points.size(); ++t) {
    if (!values.points[t]) continue;
    double* point = values.points[t]->data();
    for (auto o = static_cast<std::size_t>(graph.begin[t]); o < static_cast<std::size_t>(graph.begin[t + 1]); ++o) {
      if (!values.kept[o]) continue;
      const auto& image = graph.images[static_cast<std::size_t>(graph.observations[o].image)];
      auto& frame = values.frames[static_cast<std::size_t>(image.frame)];
      const Pose camera = camera_pose(*frame, image.mount);
      // Rotations are held, so that the arm of a camera is a constant in ground axes.
      problem.AddResidualBlock(new DirectionResidual(camera.rotation.conjugate() * rays[o],
                                                     camera.centre - frame->centre, 1 / options.ray_sigma_rad),
                               &ray_loss, frame->centre.data(), point);
    }
    ordering->AddElementToGroup(point, 0);
  }
  for (std::size_t f = 0; f < graph.frames.size(); ++f) {
    auto& frame = values.frames[f];
    if (!frame || !problem.HasParameterBlock(frame->centre.data())) continue;
    double* centre = frame->centre.data();
    ordering->AddElementToGroup(centre, 1);
    const auto& prior = graph.frames[f].position;
    // Given frames are held, so that the others come into their datum.
    if (graph.frames[f].given)
      problem.SetParameterBlockConstant(centre);
    else if (prior && options.use_positions)
      problem.AddResidualBlock(
          new StatedPosition(prior->position - frame->rotation.conjugate() * prior->lever_arm, prior->sigma),
          &position_loss, centre);
  }
  if (problem.NumResidualBlocks() == 0) return;

  ceres::Solver::Options solver;
  constexpr std::size_t kDenseFrames = 300;  // below, dense is faster
  solver.linear_solver_type = graph.frames.size() <= kDenseFrames ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.dense_linear_algebra_library_type = ceres::LAPACK;
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.max_iterations;
  // A coarse adjustment follows.
  solver.function_tolerance = 1e-4;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
}

}  // namespace megablock
