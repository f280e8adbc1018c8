// Defines the terms for given coordinates of control points: r = (X - X_0) / sigma, metres; an axis of infinite sigma
// is free. A control point that is held has no loss, which would release it.
//
// The tile of the point owns the prior, and eliminates it with the point (merge/tile/point_equations.h): normal
// equations and datum take it from the point. The prior of a point that takes no part does not count.
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/terms.h"

namespace megablock {

namespace {

class PointPriors final : public ObservationType {
  using enum ObservationKind;

 public:
  std::size_t count(const TileProblem& problem) const override { return problem.point_priors.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    TermUnknowns unknowns;
    unknowns.point = problem.point_priors[row].point.value;
    return unknowns;
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::PointTerm& term = problem.point_priors[row];
    if (!problem.active(term.point.value)) return;
    LinearTerm out;
    out.set_residual(point_prior_residual(state.points[static_cast<std::size_t>(term.point.value)], term));
    // No block of derivatives: the point takes its equations from the prior itself.
    out.number = static_cast<int>(term.sigma.array().isFinite().count());
    out.kinds = {kControlHorizontal, kControlHorizontal, kControlHeight};
    out.loss = loss_of(problem, term);
    visit(out);
  }
  RobustLoss loss(const TileProblem& problem, std::size_t row) const override {
    return loss_of(problem, problem.point_priors[row]);
  }
  void scale_sigmas(TileProblem& problem, const SigmaScales& scales) const override {
    const double horizontal = scales[kControlHorizontal];
    for (auto* terms : {&problem.point_priors, &problem.point_priors_aside})
      for (TileProblem::PointTerm& term : *terms)
        if (!held(term)) term.sigma.array() *= Eigen::Array3d(horizontal, horizontal, scales[kControlHeight]);
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    return automatic_term<3, 3>(residual::PointKnown{problem.point_priors[row]});
  }
};

}  // namespace

const ObservationType& point_priors() {
  static const PointPriors type;
  return type;
}

}  // namespace megablock
