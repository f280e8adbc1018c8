// Defines the terms for relative poses of two frames: r = Log(R_to R_from' R_m') / sigma (radians), and (R_from (C_to -
// C_from) - T_m) / sigma (metres, in the axes of the frame `from`).
//
//   E = R_to R_from' R_m':   by w_to: J_r^-1(Log E) R_m R_from,   by w_from: the negative of it
//
// The tile that would own a track of the two frames owns them. A similarity of both frames changes the length of the
// base alone.
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/terms.h"

namespace megablock {

RelativeResidual linearise_relative(const Pose& from, const Pose& to, const TileProblem::RelativeTerm& term) {
  const Eigen::Matrix3d from_rotation = from.rotation.toRotationMatrix();
  const double rotation_weight = 1 / term.rotation_sigma_rad, position_weight = 1 / term.position_sigma_m;
  const Eigen::Vector3d base = to.centre - from.centre;
  const Eigen::Vector3d rotation = rotation_log<double>(to.rotation * (term.pose.rotation * from.rotation).conjugate());
  // J_r^-1 of Log E turns a change on the right of E into one of its logarithm. With R_to Exp(w), E = R_to R_from' R_m'
  // becomes E Exp(R_m R_from w), and with R_from Exp(w) it becomes E Exp(-R_m R_from w).
  const Eigen::Matrix3d by_rotation =
      rotation_weight * right_jacobian_inverse(rotation) * term.pose.rotation.toRotationMatrix() * from_rotation;

  RelativeResidual result;
  result.residual << rotation_weight * rotation, position_weight * (from_rotation * base - term.pose.centre);
  result.by_from.setZero();
  result.by_to.setZero();
  result.by_to.topLeftCorner<3, 3>() = by_rotation;
  result.by_from.topLeftCorner<3, 3>() = -by_rotation;
  result.by_to.bottomRightCorner<3, 3>() = position_weight * from_rotation;
  // R_from Exp(w) b = R_from b - R_from [b]x w.
  result.by_from.bottomLeftCorner<3, 3>() = -position_weight * from_rotation * skew<double>(base);
  result.by_from.bottomRightCorner<3, 3>() = -position_weight * from_rotation;
  return result;
}

namespace {

class RelativePoses final : public ObservationType {
  using enum ObservationKind;

 public:
  std::size_t count(const TileProblem& problem) const override { return problem.relatives.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::RelativeTerm& term = problem.relatives[row];
    return {{term.from.value, term.to.value}, 2};
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::RelativeTerm& term = problem.relatives[row];
    const RelativeResidual r = linearise_relative(state.frames[term.from.value], state.frames[term.to.value], term);
    LinearTerm out;
    out.set_residual(r.residual);
    out.kinds = {kRelativeRotation, kRelativeRotation, kRelativeRotation,
                 kRelativePosition, kRelativePosition, kRelativePosition};
    out.add_block(LinearTerm::By::kFrame, term.from.value, r.by_from);
    out.add_block(LinearTerm::By::kFrame, term.to.value, r.by_to);
    out.loss = problem.relative_loss;
    visit(out);
  }
  TermDatum datum(const TileProblem& problem, const TileState&, std::size_t row) const override {
    const TileProblem::RelativeTerm& term = problem.relatives[row];
    TermDatum datum;
    datum.frame = term.from.value;
    // Both frames move as one body: only the scale changes the residual.
    datum.base_to = term.to.value;
    datum.base_sigma_m = term.position_sigma_m;
    return datum;
  }
  RobustLoss loss(const TileProblem& problem, std::size_t) const override { return problem.relative_loss; }
  void scale_sigmas(TileProblem& problem, const SigmaScales& scales) const override {
    for (TileProblem::RelativeTerm& term : problem.relatives) {
      term.rotation_sigma_rad *= scales[kRelativeRotation];
      term.position_sigma_m *= scales[kRelativePosition];
    }
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    return automatic_term<6, kPoseBlock, kPoseBlock>(residual::RelativeMeasured{problem.relatives[row]});
  }
};

}  // namespace

const ObservationType& relative_pose_observations() {
  static const RelativePoses type;
  return type;
}

}  // namespace megablock
