// Defines the terms for known distances of two frames, scale bars: a rod between two cameras, or the length of a GNSS
// baseline.
//
//   r = (|b| - d) / sigma,   b = C_to - C_from,   metres between the origins of the frames' rigs;
//   by d_to: b'/|b| / sigma,   by d_from: the negative of it,   by rotations: 0
//
// The tile that would own a track of the two frames owns them. A distance observes the scale of a block and nothing
// else of its datum. It has no loss, because a bar that contradicts the block must be looked at, not ignored.
#include "adjust/terms/automatic_terms.h"
#include "adjust/terms/terms.h"

namespace megablock {

namespace {

constexpr double kShortestBase = 1e-9;  // metres; a shorter base has no direction

struct DistanceKnown {
  double distance, sigma;
  template <typename Scalar>
  bool operator()(const Scalar* from, const Scalar* to, Scalar* result) const {
    using std::sqrt;
    Scalar squares(0);
    for (int i = 4; i < kPoseBlock; ++i) squares += (to[i] - from[i]) * (to[i] - from[i]);
    result[0] = (sqrt(squares) - distance) / sigma;
    return true;
  }
};

class KnownDistances final : public ObservationType {
  using Rows = std::vector<TileProblem::MeasuredTerm>;

 public:
  std::size_t count(const TileProblem& problem) const override {
    const auto rows = problem.measured.find(kKey);
    return rows == problem.measured.end() ? 0 : rows->second.size();
  }
  TermUnknowns unknowns(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::MeasuredTerm& term = term_of(problem, row);
    return {{term.from.value, term.to.value}, 2};
  }
  void linearise(const TileProblem& problem, const TileState& state, std::size_t row,
                 const TermVisit& visit) const override {
    const TileProblem::MeasuredTerm& term = term_of(problem, row);
    const Eigen::Vector3d base = state.frames[term.to.value].centre - state.frames[term.from.value].centre;
    const double length = base.norm();
    Eigen::Matrix<double, 1, 6> by_to = Eigen::Matrix<double, 1, 6>::Zero();
    // Centres at the same place get no derivative. The residual stays, so that the statistics show it.
    if (length > kShortestBase) by_to.tail<3>() = base.transpose() / (length * term.sigma);
    LinearTerm out;
    out.set_residual(Eigen::Matrix<double, 1, 1>((length - term.value) / term.sigma));
    out.kinds.fill(ObservationKind::kDistance);
    out.add_block(LinearTerm::By::kFrame, term.from.value, -by_to);
    out.add_block(LinearTerm::By::kFrame, term.to.value, by_to);
    visit(out);
  }
  TermDatum datum(const TileProblem& problem, const TileState&, std::size_t row) const override {
    const TileProblem::MeasuredTerm& term = term_of(problem, row);
    TermDatum datum;
    datum.frame = term.from.value;
    datum.base_to = term.to.value;
    datum.base_sigma_m = term.sigma;
    return datum;
  }
  ceres::CostFunction* automatic(const TileProblem& problem, std::size_t row) const override {
    const TileProblem::MeasuredTerm& term = term_of(problem, row);
    return automatic_term<1, kPoseBlock, kPoseBlock>(DistanceKnown{term.value, term.sigma});
  }

 private:
  static constexpr const char* kKey = "distances";  // io/block/frame_measurements.cpp
  static const TileProblem::MeasuredTerm& term_of(const TileProblem& problem, std::size_t row) {
    return problem.measured.at(kKey)[row];
  }
};

}  // namespace

const ObservationType& distance_observations() {
  static const KnownDistances type;
  return type;
}

}  // namespace megablock
