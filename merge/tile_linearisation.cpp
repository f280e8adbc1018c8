#include "merge/tile_linearisation.h"

#include "adjust/line_terms.h"

namespace megablock {

namespace {

using enum ObservationKind;
constexpr std::array<ObservationKind, 6> kPositionKinds{kPositionHorizontal, kPositionHorizontal, kPositionHeight};
constexpr std::array<ObservationKind, 6> kRelativeKinds{kRelativeRotation, kRelativeRotation, kRelativeRotation,
                                                        kRelativePosition, kRelativePosition, kRelativePosition};

}  // namespace

void visit_terms(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                 std::size_t cell, const std::function<void(const TermResidual&)>& visit) {
  const RobustLoss none;
  for (std::int64_t i : plan.positions[cell]) {
    const auto& term = problem.positions[static_cast<std::size_t>(i)];
    const FrameResidual3 r = linearise_position(state.frames[term.frame.value], term.prior);
    TermResidual out;
    out.residual = r.residual;
    out.kinds = kPositionKinds;
    out.add_block(plan.unknown_of_frame[term.frame.value], r.by_frame);
    out.weight(problem.position_loss, pass);
    visit(out);
  }
  for (std::int64_t i : plan.attitudes[cell]) {
    const auto& term = problem.attitudes[static_cast<std::size_t>(i)];
    const FrameResidual3 r = linearise_attitude(state.frames[term.frame.value], term.prior);
    TermResidual out;
    out.residual = r.residual;
    out.kinds.fill(ObservationKind::kAttitude);
    out.add_block(plan.unknown_of_frame[term.frame.value], r.by_frame);
    out.weight(problem.attitude_loss, pass);
    visit(out);
  }
  for (std::int64_t i : plan.lines[cell]) {
    const auto& term = problem.lines[static_cast<std::size_t>(i)];
    const LineResidual r = linearise_line(state.frames[term.frame.value], state.frames[term.seen_by().value], term);
    TermResidual out;
    out.residual = Eigen::Matrix<double, 1, 1>(r.residual);
    out.kinds.fill(ObservationKind::kLine);
    out.add_block(plan.unknown_of_frame[term.frame.value], r.by_frame);
    if (term.other.valid()) out.add_block(plan.unknown_of_frame[term.other.value], r.by_other);
    out.weight(problem.line_loss, pass);
    visit(out);
  }
  for (std::int64_t i : plan.relatives[cell]) {
    const auto& term = problem.relatives[static_cast<std::size_t>(i)];
    const RelativeResidual r = linearise_relative(state.frames[term.from.value], state.frames[term.to.value], term);
    TermResidual out;
    out.residual = r.residual;
    out.kinds = kRelativeKinds;
    out.add_block(plan.unknown_of_frame[term.from.value], r.by_from);
    out.add_block(plan.unknown_of_frame[term.to.value], r.by_to);
    out.weight(problem.relative_loss, pass);
    visit(out);
  }
  for (std::int64_t i : plan.intrinsic_priors[cell]) {
    const auto& term = problem.intrinsic_priors[static_cast<std::size_t>(i)];
    const auto camera = static_cast<std::size_t>(term.camera.value);
    const int free_count = count_of(problem.camera_free[camera]);
    int column = 0;
    for (int k = 0; k < term.value.size(); ++k) {
      const bool free = contains(problem.camera_free[camera], k);
      const double weight = intrinsic_prior_weight(term, k);
      if (weight != 0) {
        TermResidual out;
        out.residual = Eigen::Matrix<double, 1, 1>(intrinsic_prior_residual(state.cameras[camera], term, k));
        out.kinds.fill(ObservationKind::kIntrinsics);
        Eigen::MatrixXd row = Eigen::MatrixXd::Zero(1, free_count);
        if (free) {
          row(0, column) = weight;
          out.add_block(plan.unknown_of_camera[camera], row);
        }
        out.weight(none, pass);
        visit(out);
      }
      column += free;
    }
  }
  for (std::int64_t i : plan.mount_priors[cell]) {
    const auto& term = problem.mount_priors[static_cast<std::size_t>(i)];
    const MountResidual r = linearise_mount(state.mounts[static_cast<std::size_t>(term.mount)], term);
    TermResidual out;
    out.residual = r.residual;
    out.kinds.fill(ObservationKind::kMount);
    out.add_block(plan.unknown_of_mount[static_cast<std::size_t>(term.mount)], r.by_mount);
    out.weight(none, pass);
    visit(out);
  }
}

std::vector<std::int64_t> prior_rows(const TileProblem& problem) {
  std::vector<std::int64_t> rows(problem.points.size(), -1);
  for (std::size_t i = 0; i < problem.point_priors.size(); ++i)
    rows[static_cast<std::size_t>(problem.point_priors[i].point.value)] = static_cast<std::int64_t>(i);
  return rows;
}

PointEquations::Block& PointEquations::block_of(std::int64_t unknown, int dimension) {
  std::int32_t& slot = slot_[static_cast<std::size_t>(unknown)];
  if (slot < 0) {
    slot = static_cast<std::int32_t>(blocks_.size());
    blocks_.emplace_back();
    blocks_.back().unknown = unknown;
    blocks_.back().dimension = dimension;
    blocks_.back().w.setZero(dimension, 3);
  }
  return blocks_[static_cast<std::size_t>(slot)];
}

void PointEquations::linearise(std::int64_t point, const Pass& pass) {
  for (const Block& block : blocks_) slot_[static_cast<std::size_t>(block.unknown)] = -1;
  blocks_.clear();
  observations_.clear();
  v_.setZero();
  b_.setZero();
  rho_ = weighted_squares_ = 0;
  residual_count_ = 0;
  for (std::int64_t row = problem_.begin[point]; row < problem_.begin[point + 1]; ++row)
    if (problem_.kept[row]) add_observation(point, row, pass.curvature);
  if (const std::int64_t i = prior_[static_cast<std::size_t>(point)]; i >= 0) {
    const auto& term = problem_.point_priors[static_cast<std::size_t>(i)];
    const Eigen::Vector3d weight = term.sigma.cwiseInverse();  // 0 on a free axis
    const Eigen::Vector3d r = point_prior_residual(state_.points[point], term);
    v_.diagonal() += weight.cwiseAbs2();
    b_ -= weight.cwiseProduct(r);
    rho_ += r.squaredNorm();
    weighted_squares_ += r.squaredNorm();
    residual_count_ += (weight.array() > 0).count();
  }
  factorise(pass.lambda);
}

void PointEquations::add_observation(std::int64_t point, std::int64_t row, bool curvature) {
  const TileImage& image = problem_.images[problem_.image[row].value];
  const auto frame = image.frame.value, camera = image.camera.value, mount = image.mount;
  const ImageResidual r =
      linearise_image(state_.frames[frame], state_.mounts[mount], state_.cameras[camera], state_.points[point],
                      {problem_.x[row], problem_.y[row]}, problem_.inverse_sigma[row]);
  if (!r.in_front)
    throw ComputeError("a kept observation of point " + std::to_string(problem_.points[point].index) +
                       " lies behind image " + std::to_string(image.image.value));
  const double squares = r.residual.squaredNorm();
  const LossWeight weight(problem_.image_loss, squares, curvature);
  rho_ += weight.rho;
  weighted_squares_ += weight.first * squares;
  residual_count_ += 2;

  Observation& observation = observations_.emplace_back();
  observation.residual = weight.residual_scale * r.residual;
  const Eigen::Matrix<double, 2, 3> by_point = weight.weighted(r.by_point, r.residual);
  observation.by_point = by_point;
  v_.noalias() += by_point.transpose() * by_point;
  b_.noalias() -= by_point.transpose() * observation.residual;

  const auto add = [&](std::int64_t unknown, const auto& jacobian, int dimension) {
    auto& block = observation.blocks[static_cast<std::size_t>(observation.block_count++)];
    block.unknown = unknown;
    block.jacobian = jacobian;
    block_of(unknown, dimension).w.noalias() += block.jacobian.transpose() * by_point;
  };
  add(plan_.unknown_of_frame[frame], weight.weighted(r.by_frame, r.residual), 6);
  if (const std::int64_t unknown = plan_.unknown_of_camera[camera]; unknown >= 0) {
    const ParameterMask free = problem_.camera_free[camera];
    const auto weighted = weight.weighted(r.by_intrinsics, r.residual);
    IntrinsicJacobian jacobian(2, count_of(free));
    for (int k = 0, column = 0; k < weighted.cols(); ++k)
      if (contains(free, k)) jacobian.col(column++) = weighted.col(k);
    add(unknown, jacobian, count_of(free));
  }
  if (const std::int64_t unknown = plan_.unknown_of_mount[mount]; unknown >= 0)
    add(unknown, weight.weighted(r.by_mount, r.residual), 6);
}

void PointEquations::factorise(double lambda) {
  diagonal_ = v_.diagonal();
  Eigen::Matrix3d c = v_;
  c.diagonal() += lambda * diagonal_;
  held_ = 0;
  std::array<bool, 3> held{};
  for (int k = 0; k < 3; ++k) {
    if (!(c(k, k) > kPivotTolerance * (1 + lambda) * diagonal_[k])) {
      held[static_cast<std::size_t>(k)] = true;
      ++held_;
      for (int j = 0; j < k; ++j) c(k, j) = 0;
      for (int i = k + 1; i < 3; ++i) c(i, k) = 0;
      c(k, k) = 1;
      continue;
    }
    c(k, k) = std::sqrt(c(k, k));
    for (int i = k + 1; i < 3; ++i) c(i, k) /= c(k, k);
    for (int j = k + 1; j < 3; ++j)
      for (int i = j; i < 3; ++i) c(i, j) -= c(i, k) * c(j, k);
  }
  inverse_.setIdentity();
  c.triangularView<Eigen::Lower>().solveInPlace(inverse_);
  for (int k = 0; k < 3; ++k)
    if (held[static_cast<std::size_t>(k)]) inverse_.row(k).setZero();
  z_ = inverse_ * b_;
  for (Block& block : blocks_) block.w = (block.w * inverse_.transpose()).eval();
}

}  // namespace megablock
