#include "merge/tile/tile_linearisation.h"

#include "adjust/terms/line_terms.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/vertical_terms.h"

namespace megablock {

namespace {

using enum ObservationKind;
constexpr std::array<ObservationKind, 6> kPositionKinds{kPositionHorizontal, kPositionHorizontal, kPositionHeight};
constexpr std::array<ObservationKind, 6> kRelativeKinds{kRelativeRotation, kRelativeRotation, kRelativeRotation,
                                                        kRelativePosition, kRelativePosition, kRelativePosition};

Eigen::MatrixXd free_columns(const Eigen::Matrix2Xd& by_parameters, ParameterMask free) {
  Eigen::MatrixXd columns(2, count_of(free));
  Eigen::Index column = 0;
  for (int p = 0; p < by_parameters.cols(); ++p)
    if (contains(free, p)) columns.col(column++) = by_parameters.col(p);
  return columns;
}

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
    out.weight(loss_of(problem, term), pass);
    visit(out);
  }
  for (std::int64_t i : plan.attitudes[cell]) {
    const auto& term = problem.attitudes[static_cast<std::size_t>(i)];
    const FrameResidual3 r = linearise_attitude(state.frames[term.frame.value], term.prior);
    TermResidual out;
    out.residual = r.residual;
    out.kinds.fill(ObservationKind::kAttitude);
    out.add_block(plan.unknown_of_frame[term.frame.value], r.by_frame);
    out.weight(loss_of(problem, term), pass);
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
  for (std::int64_t i : plan.verticals[cell]) {
    const auto& term = problem.verticals[static_cast<std::size_t>(i)];
    const TileImage& image = problem.images[static_cast<std::size_t>(term.image.value)];
    const auto camera = static_cast<std::size_t>(image.camera.value), mount = static_cast<std::size_t>(image.mount);
    const VerticalResidual r = linearise_vertical(problem, state, term);
    TermResidual out;
    out.residual = r.residual;
    out.kinds.fill(ObservationKind::kVertical);
    out.add_block(plan.unknown_of_frame[image.frame.value], r.by_frame);
    out.add_block(plan.unknown_of_mount[mount], r.by_mount);
    if (term.camera.size() > 0)
      out.add_block(plan.unknown_of_camera[camera], free_columns(-term.by_camera, plan.camera_free[camera]));
    out.weight(problem.vertical_loss, pass);
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
    const int free_count = count_of(plan.camera_free[camera]);
    int column = 0;
    for (int k = 0; k < term.value.size(); ++k) {
      const bool free = contains(plan.camera_free[camera], k);
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

}  // namespace megablock
