// Defines the terms for attitudes of frames: r = Log(R R_0') / sigma, about the axes of the rig, radians.
//
//   Log(R Exp(w) R_0') = Log(E Exp(R_0 w)),  E = R R_0':   by w: J_r^-1(Log E) R_0
//
// The tile of the frame owns them. A held attitude (io/block/held_priors.h) has no loss, which would release it.
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/rotation_difference.h"
#include "adjust/terms/terms.h"

namespace megablock {

FrameResidual3 linearise_attitude(const Pose& frame, const AttitudePrior& prior) {
  const Eigen::Vector3d weight = prior.sigma_rad.cwiseInverse();
  const RotationDifference difference = rotation_difference(frame.rotation, prior.rotation_cw);
  FrameResidual3 result;
  result.residual = weight.cwiseProduct(difference.value);
  // By the rotation, then by the centre.
  result.by_frame << weight.asDiagonal() * difference.by_rotation, Eigen::Matrix3d::Zero();
  return result;
}

namespace {

class Attitudes final : public ObservationType {
 public:
  std::size_t count(const TileProblem& problem) const override { return problem.attitudes.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    return {{problem.attitudes[row].frame.value}, 1};
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::AttitudeTerm& term = problem.attitudes[row];
    const FrameResidual3 r = linearise_attitude(state.frames[term.frame.value], term.prior);
    LinearTerm out;
    out.set_residual(r.residual);
    out.kinds.fill(ObservationKind::kAttitude);
    out.add_block(LinearTerm::By::kFrame, term.frame.value, r.by_frame);
    out.loss = loss_of(problem, term);
    visit(out);
  }
  TermDatum datum(const TileProblem& problem, const TileState& state, std::size_t row) const override {
    const TileProblem::AttitudeTerm& term = problem.attitudes[row];
    TermDatum datum;
    datum.frame = term.frame.value;
    datum.by_frame = linearise_attitude(state.frames[term.frame.value], comparable(term.prior)).by_frame;
    return datum;
  }
  RobustLoss loss(const TileProblem& problem, std::size_t row) const override {
    return loss_of(problem, problem.attitudes[row]);
  }
  void scale_sigmas(TileProblem& problem, const SigmaScales& scales) const override {
    for (TileProblem::AttitudeTerm& term : problem.attitudes)
      term.prior.sigma_rad *= scales[ObservationKind::kAttitude];
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    return automatic_term<3, kPoseBlock>(residual::AttitudeMeasured{problem.attitudes[row].prior});
  }
};

}  // namespace

const ObservationType& attitude_observations() {
  static const Attitudes type;
  return type;
}

}  // namespace megablock
