// Defines the terms for attitudes of frames: r = Log(R R_0') / sigma, about the axes of the rig, radians.
//
//   Log(R Exp(w) R_0') = Log(E Exp(R_0 w)),  E = R R_0':   by w: J_r^-1(Log E) R_0
//
// A receiver in the block has turned R_0 to R_m' R_0 (io/block/observed_poses.h). With R_m Exp(v), E becomes E Exp(v),
// and the derivative by v is J_r^-1(Log E).
//
// The tile of the frame owns them. A held attitude (io/block/held_priors.h) has no loss, which would release it.
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/rotation_difference.h"
#include "adjust/terms/terms.h"
#include "io/block/observed_poses.h"

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

AttitudePrior prior_of(const TileProblem::AttitudeTerm& term, const TileState& state) {
  return term.receiver < 0 ? term.prior : corrected(term.prior, state.mounts[static_cast<std::size_t>(term.receiver)]);
}

namespace {

class Attitudes final : public ObservationType {
 public:
  std::size_t count(const TileProblem& problem) const override { return problem.attitudes.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    TermUnknowns unknowns{{problem.attitudes[row].frame.value}, 1};
    unknowns.mounts[0] = problem.attitudes[row].receiver;
    return unknowns;
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::AttitudeTerm& term = problem.attitudes[row];
    const AttitudePrior prior = prior_of(term, state);
    const FrameResidual3 r = linearise_attitude(state.frames[term.frame.value], prior);
    LinearTerm out;
    out.set_residual(r.residual);
    out.kinds.fill(ObservationKind::kAttitude);
    out.add_block(LinearTerm::By::kFrame, term.frame.value, r.by_frame);
    if (term.receiver >= 0) {
      // J_r^-1 is the derivative by the frame without R_0.
      Eigen::Matrix<double, 3, 6> by_receiver = Eigen::Matrix<double, 3, 6>::Zero();
      by_receiver.leftCols<3>() = r.by_frame.leftCols<3>() * prior.rotation_cw.conjugate().toRotationMatrix();
      out.add_block(LinearTerm::By::kMount, term.receiver, by_receiver);
    }
    out.loss = loss_of(problem, term);
    visit(out);
  }
  TermDatum datum(const TileProblem& problem, const TileState& state, std::size_t row) const override {
    const TileProblem::AttitudeTerm& term = problem.attitudes[row];
    TermDatum datum;
    datum.frame = term.frame.value;
    datum.by_frame = linearise_attitude(state.frames[term.frame.value], comparable(prior_of(term, state))).by_frame;
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
    const TileProblem::AttitudeTerm& term = problem.attitudes[row];
    const residual::AttitudeMeasured measured{term.prior};
    if (term.receiver < 0) return automatic_term<3, kPoseBlock>(measured);
    return automatic_term<3, kPoseBlock, kPoseBlock>(measured);
  }
};

}  // namespace

const ObservationType& attitude_observations() {
  static const Attitudes type;
  return type;
}

}  // namespace megablock
