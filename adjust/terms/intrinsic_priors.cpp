// Defines the terms for priors of camera parameters: r = (k - k_0) / sigma for each parameter with a finite positive
// sigma, each independent of the others.
//
// The tile of the first oriented image of the camera owns them.
#include <algorithm>
#include <array>

#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/linearise.h"
#include "adjust/terms/terms.h"

namespace megablock {

namespace {

// Residuals of the leading parameters of a camera, as far as one of them has a prior or is not rare.
struct DynamicIntrinsicsKnown {
  residual::IntrinsicsKnown known;
  int rows;
  template <typename Scalar>
  bool operator()(const Scalar* const* blocks, Scalar* result) const {
    std::array<Scalar, kMaxIntrinsics> all;
    known(blocks[0], all.data());
    std::copy_n(all.begin(), rows, result);
    return true;
  }
};

// Residuals that are always zero would still change how Ceres sums its cost, and so the last bits of a result.
int rows_of(const TileProblem::IntrinsicTerm& term) {
  int rows = count_without_rare(term.value.model());
  for (int k = rows; k < term.value.size(); ++k)
    if (intrinsic_prior_weight(term, k) > 0) rows = k + 1;
  return rows;
}

class IntrinsicPriors final : public ObservationType {
 public:
  std::size_t count(const TileProblem& problem) const override { return problem.intrinsic_priors.size(); }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    TermUnknowns unknowns;
    unknowns.camera = static_cast<std::int32_t>(problem.intrinsic_priors[row].camera.value);
    return unknowns;
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::IntrinsicTerm& term = problem.intrinsic_priors[row];
    const auto camera = static_cast<std::int32_t>(term.camera.value);
    // Each parameter with a prior is one scalar observation.
    for (int k = 0; k < term.value.size(); ++k) {
      const double weight = intrinsic_prior_weight(term, k);
      if (weight == 0) continue;
      const double r = intrinsic_prior_residual(state.cameras[static_cast<std::size_t>(camera)], term, k);
      LinearTerm out;
      out.set_residual(Eigen::Matrix<double, 1, 1>(r));
      out.kinds.fill(ObservationKind::kIntrinsics);
      Eigen::RowVectorXd by_camera = Eigen::RowVectorXd::Zero(term.value.size());
      by_camera[k] = weight;
      out.add_block(LinearTerm::By::kCamera, camera, by_camera);
      visit(out);
    }
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::IntrinsicTerm& term = problem.intrinsic_priors[row];
    const int rows = rows_of(term);
    return automatic_dynamic_term(DynamicIntrinsicsKnown{residual::IntrinsicsKnown{term}, rows}, rows,
                                  {term.value.size()});
  }
};

}  // namespace

const ObservationType& intrinsic_priors() {
  static const IntrinsicPriors type;
  return type;
}

}  // namespace megablock
