// Defines the terms for positions of frames, as GNSS observes them: r = (C + R' l - P) / sigma, with l the lever arm in
// the axes of the rig, metres. A receiver in the block adds its centre c to l, and a group of positions its shift o to
// the place (io/block/observed_poses.h).
//
//   C + R' l + o:   by w: [R' l]x (as Exp(-w) R' l),   by d: I,   by c: R',   by o: I for the shifted axes
//
// The tile of the frame owns them. A held position (io/block/held_priors.h) has no loss, which would release it.
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/terms.h"
#include "io/block/observed_poses.h"

namespace megablock {

FrameResidual3 linearise_position(const Pose& frame, const PositionPrior& prior) {
  const Eigen::Vector3d arm = frame.rotation.conjugate() * prior.lever_arm;
  const Eigen::Vector3d weight = prior.sigma.cwiseInverse();
  FrameResidual3 result;
  result.residual = weight.cwiseProduct(frame.centre - prior.position + arm);
  result.by_frame << weight.asDiagonal() * skew<double>(arm), Eigen::Matrix3d(weight.asDiagonal());
  return result;
}

PositionPrior prior_of(const TileProblem::PositionTerm& term, const TileState& state) {
  PositionPrior prior = term.prior;
  if (term.group >= 0) prior = without_shift(prior, state.mounts[static_cast<std::size_t>(term.group)]);
  return term.receiver < 0 ? prior : corrected(prior, state.mounts[static_cast<std::size_t>(term.receiver)]);
}

LinearTerm linearise_position(const TileProblem::PositionTerm& term, const TileState& state) {
  using enum ObservationKind;
  const Pose& frame = state.frames[static_cast<std::size_t>(term.frame.value)];
  const FrameResidual3 r = linearise_position(frame, prior_of(term, state));
  LinearTerm out;
  out.set_residual(r.residual);
  out.kinds = {kPositionHorizontal, kPositionHorizontal, kPositionHeight};
  out.add_block(LinearTerm::By::kFrame, term.frame.value, r.by_frame);
  const Eigen::Vector3d weight = term.prior.sigma.cwiseInverse();
  const auto add_mount = [&](std::int32_t mount, const Eigen::Matrix3d& by_centre) {
    if (mount < 0) return;
    Eigen::Matrix<double, 3, 6> by_mount = Eigen::Matrix<double, 3, 6>::Zero();
    by_mount.rightCols<3>() = weight.asDiagonal() * by_centre;
    out.add_block(LinearTerm::By::kMount, mount, by_mount);
  };
  add_mount(term.receiver, frame.rotation.conjugate().toRotationMatrix());
  add_mount(term.group, term.prior.shifted.cast<double>().asDiagonal());
  return out;
}

namespace {

class Positions final : public ObservationType {
  using enum ObservationKind;

 public:
  std::size_t count(const TileProblem& problem) const override { return problem.positions.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    TermUnknowns unknowns{{problem.positions[row].frame.value}, 1};
    unknowns.mounts = {problem.positions[row].receiver, problem.positions[row].group};
    return unknowns;
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    LinearTerm out = linearise_position(problem.positions[row], state);
    out.loss = loss_of(problem, problem.positions[row]);
    visit(out);
  }
  TermDatum datum(const TileProblem& problem, const TileState& state, std::size_t row) const override {
    const TileProblem::PositionTerm& term = problem.positions[row];
    TermDatum datum;
    datum.frame = term.frame.value;
    // A held position has a sigma of nanometres. With its own weight it would make every other information about the
    // datum look like nothing (comparable() in io/block/held_priors.h).
    datum.by_frame = linearise_position(state.frames[term.frame.value], comparable(prior_of(term, state))).by_frame;
    datum.holds_place = held(term.prior);
    return datum;
  }
  RobustLoss loss(const TileProblem& problem, std::size_t row) const override {
    return loss_of(problem, problem.positions[row]);
  }
  void scale_sigmas(TileProblem& problem, const SigmaScales& scales) const override {
    // GNSS heights are worse than horizontal positions, and their errors have other causes. They have a factor of their
    // own.
    for (auto* terms : {&problem.positions, &problem.positions_aside})
      for (TileProblem::PositionTerm& term : *terms) {
        if (held(term.prior)) continue;
        const PositionScale scale = scales.of_positions(term.prior.group);
        term.prior.sigma.array() *= Eigen::Array3d(scale.horizontal, scale.horizontal, scale.height);
      }
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::PositionTerm& term = problem.positions[row];
    const residual::PositionMeasured measured{term.prior, term.receiver >= 0};
    const int mounts = (term.receiver >= 0 ? 1 : 0) + (term.group >= 0 ? 1 : 0);
    if (mounts == 0) return automatic_term<3, kPoseBlock>(measured);
    if (mounts == 1) return automatic_term<3, kPoseBlock, kPoseBlock>(measured);
    return automatic_term<3, kPoseBlock, kPoseBlock, kPoseBlock>(measured);
  }
};

}  // namespace

const ObservationType& position_observations() {
  static const Positions type;
  return type;
}

}  // namespace megablock
