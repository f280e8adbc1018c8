// Let r be the residual of an observation, divided by its sigma, Q the covariance of the block in the directions of r,
// and w the weight with which the observation took part. Without it the block has the covariance Q_ and the distance d
// from the observation:
//
//     Q_ = (Q^-1 - w I)^-1,     d = r + w Q_ r,     cov(d) = I + Q_.
//
// In the axes of Q, with its eigenvalues q and the redundancy u = 1 - w q, these are q / u, r / u and (u + q) / u, so
// that the squared length of d in its own sigmas is the sum of r^2 / (u (u + q)). With w = 1 this is Baarda's test
// quantity r' (I - Q)^-1 r. Where u is zero, nothing else determines the block.
//
// The observation moves the block by w Q_ r. In the sigmas of Q the square of this is the sum of w^2 q r^2 / u^2.
//
// An observation is far off where a length |d| so large is less likely than kChance among all n observations of its
// kind: n P(chi > |d|) < kChance. Sigmas may be somewhat too small, because prior_scales.h leaves a factor of up to
// three to the losses. Where the median of |d| over the kind is larger than it should be, lengths are divided by that
// factor; but not those of few observations that take part, to all of which a single gross error spreads.
#include "adjust/checks/prior_test.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "adjust/terms/linearise.h"
#include "adjust/terms/prior_loss.h"
#include "adjust/terms/terms.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/decompositions.h"

namespace megablock {

namespace {

constexpr double kUntested = 1e-6;  // redundancy
// The median of the length of m normal deviates; [m].
constexpr std::array kMedians{1.0, 0.6745, 1.1774, 1.5382};
constexpr double kChance = 0.01;         // that a block without gross errors has an observation that is far off
constexpr double kPulls = 0.3;           // sigmas of the block: less is left to the loss
constexpr double kPullsFew = 0.05;       // the same of few positions, which a block adjusts again at once
constexpr double kEstimated = 1.25;      // a factor of sigmas from the median of ten residuals may be so much too small
constexpr double kNearWorst = 0.7;       // share of the worst length
constexpr std::int64_t kFew = 30;        // observations of a kind; one of so many is set aside at a time
constexpr std::int64_t kLeastKind = 5;   // observations of a kind; one of so many may be set aside
constexpr std::size_t kMostCleared = 2;  // each cost two adjustments for nothing

double chance(const PriorTest& test, double factor) {
  const double length = test.sigmas / factor;
  return test.axes == 0 ? 1 : chi_square_exceeds(length * length, test.axes);
}

// `least`: pulls that count.
void add_test(const PriorId& id, PriorTest test, double least, PriorTests& tests) {
  if (test.axes == 0) return;
  test.prior = id;
  (id.is_control ? tests.control : tests.positions).add(test.sigmas / kMedians[static_cast<std::size_t>(test.axes)]);
  if (test.pull > least && chance(test, 1) < kChance / kLeastKind) tests.far_off.push_back(test);
}

// What is known of the positions, or of the control points.
struct PriorsOfKind {
  std::int64_t all = 0;   // observations, with those that are set aside
  std::int64_t room = 0;  // so many more may be set aside now
  // By how much the sigmas may be too small; and by how much the lengths are larger than they should be, or this.
  double least = 1, excess = 1;
  bool far_off(const PriorTest& test) const {
    if (test.pull < (all > kFew || test.prior.is_control ? kPulls : kPullsFew)) return false;
    return static_cast<double>(all) * chance(test, all > kFew ? excess : least) < kChance;
  }
  bool agrees(const PriorTest& test) const {
    return test.axes > 0 && static_cast<double>(all) * chance(test, excess) >= kChance;
  }
};

PriorsOfKind kind_of(const LengthCounts& counts, std::int64_t aside, bool scaled) {
  PriorsOfKind kind;
  kind.all = counts.total() + aside;
  if (kind.all >= kLeastKind)
    kind.room = std::min((kind.all + kLeastKind - 1) / kLeastKind - aside, 1 + kind.all / kFew);
  kind.least = scaled ? kEstimated : 1;
  kind.excess = std::max(kind.least, counts.median());
  return kind;
}

bool holds(const std::vector<PriorId>& list, const PriorId& prior) {
  return std::ranges::find(list, prior) != list.end();
}

}  // namespace

void PriorTests::add(const PriorTests& other) {
  positions.add(other.positions);
  control.add(other.control);
  far_off.insert(far_off.end(), other.far_off.begin(), other.far_off.end());
  aside.insert(aside.end(), other.aside.begin(), other.aside.end());
}

PriorTest test_prior(const Eigen::Vector3d& r, const Eigen::Matrix3d& covariance, double weight) {
  const SymmetricEigen3 axes = symmetric_eigen3(covariance);
  const Eigen::Vector3d along = axes.vectors.transpose() * r;
  PriorTest test;
  double squares = 0, pull = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double q = std::max(0.0, axes.values[axis]), redundancy = 1 - weight * q;
    if (redundancy < kUntested) continue;
    const double square = along[axis] * along[axis];
    squares += square / (redundancy * (redundancy + q));
    pull += weight * weight * q * square / (redundancy * redundancy);
    ++test.axes;
  }
  test.sigmas = std::sqrt(squares);
  test.pull = std::sqrt(pull);
  return test;
}

namespace {

class PriorTester {
 public:
  PriorTester(const TileProblem& problem, const TileState& state, const PriorCovariances& covariances)
      : problem_(problem), state_(state), covariances_(covariances) {}

  PriorTests run() {
    const bool few = std::ssize(problem_.positions) <= kFew;
    for (std::size_t i = 0; i < problem_.positions.size(); ++i) {
      const TileProblem::PositionTerm& term = problem_.positions[i];
      if (tells(term, covariances_.positions[i]))
        add_test(id_of(term), test(term, covariances_.positions[i], loss_of(problem_, term)), few ? kPullsFew : kPulls,
                 tests_);
    }
    for (const auto& term : problem_.point_priors)
      if (tells(term)) add_test(id_of(term), test(term, loss_of(problem_, term)), kPulls, tests_);
    for (std::size_t i = 0; i < problem_.positions_aside.size(); ++i) {
      const TileProblem::PositionTerm& term = problem_.positions_aside[i];
      const Eigen::Matrix3d& covariance = covariances_.positions_aside[i];
      add_aside(id_of(term), tells(term, covariance) ? test(term, covariance, std::nullopt) : PriorTest());
    }
    for (const auto& term : problem_.point_priors_aside)
      add_aside(id_of(term), tells(term) ? test(term, std::nullopt) : PriorTest());
    return std::move(tests_);
  }

 private:
  PriorId id_of(const TileProblem::PositionTerm& term) const {
    return {problem_.frames[static_cast<std::size_t>(term.frame.value)].value, 0};
  }
  PriorId id_of(const TileProblem::PointTerm& term) const { return {problem_.points[row(term)].index, 1}; }
  static std::size_t row(const TileProblem::PointTerm& term) { return static_cast<std::size_t>(term.point.value); }

  // Whether the observation is uncertain and the block knows its place.
  static bool tells(const TileProblem::PositionTerm& term, const Eigen::Matrix3d& covariance) {
    return !held(term.prior) && !covariance.isZero(0);
  }
  bool tells(const TileProblem::PointTerm& term) const { return !held(term) && problem_.active(term.point.value); }

  // `loss`: empty for an observation that takes no part.
  PriorTest test(const TileProblem::PositionTerm& term, const Eigen::Matrix3d& covariance,
                 const std::optional<RobustLoss>& loss) const {
    return test(linearise_position(term, state_).residual, covariance, loss);
  }
  PriorTest test(const TileProblem::PointTerm& term, const std::optional<RobustLoss>& loss) const {
    const Eigen::Vector3d inverse = term.sigma.cwiseInverse();
    return test(point_prior_residual(state_.points[row(term)], term),
                inverse.asDiagonal() * covariances_.points[row(term)] * inverse.asDiagonal(), loss);
  }
  static PriorTest test(const Eigen::Vector3d& r, const Eigen::Matrix3d& covariance,
                        const std::optional<RobustLoss>& loss) {
    return test_prior(r, covariance, loss ? loss->evaluate(r.squaredNorm())[1] : 0);
  }
  void add_aside(const PriorId& id, PriorTest test) {
    test.prior = id;
    tests_.aside.push_back(test);
  }

  const TileProblem& problem_;
  const TileState& state_;
  const PriorCovariances& covariances_;
  PriorTests tests_;
};

// Moves the first term for which `is` holds to its place in the other list; both ascend by `row`.
template <typename Term, typename Row>
void move_term(std::vector<Term>& from, std::vector<Term>& to, Row Term::*row, const auto& is) {
  const auto found = std::ranges::find_if(from, is);
  if (found == from.end()) return;
  to.insert(std::ranges::upper_bound(to, (*found).*row, {}, row), *found);
  from.erase(found);
}

void move_priors(const std::vector<PriorId>& priors, TileProblem& problem, bool aside) {
  auto *positions = &problem.positions, *other_positions = &problem.positions_aside;
  auto *control = &problem.point_priors, *other_control = &problem.point_priors_aside;
  if (!aside) {
    std::swap(positions, other_positions);
    std::swap(control, other_control);
  }
  for (const PriorId& prior : priors)
    if (prior.is_control)
      move_term(*control, *other_control, &TileProblem::PointTerm::point, [&](const TileProblem::PointTerm& term) {
        return problem.points[static_cast<std::size_t>(term.point.value)].index == prior.row;
      });
    else
      move_term(*positions, *other_positions, &TileProblem::PositionTerm::frame,
                [&](const TileProblem::PositionTerm& term) {
                  return problem.frames[static_cast<std::size_t>(term.frame.value)].value == prior.row;
                });
  for (const auto& term : problem.point_priors)
    problem.points[static_cast<std::size_t>(term.point.value)].role = PointRole::kControl;
  for (const auto& term : problem.point_priors_aside)
    problem.points[static_cast<std::size_t>(term.point.value)].role = PointRole::kCheck;
}

}  // namespace

PriorTests test_priors(const TileProblem& problem, const TileState& state, const PriorCovariances& covariances) {
  return PriorTester(problem, state, covariances).run();
}

PriorVerdicts change_verdicts(const PriorTests& tests, const PriorVerdicts& now, std::array<bool, 2> scaled) {
  const auto aside = [&](std::int64_t is_control) {
    return std::ranges::count(now.aside, is_control, &PriorId::is_control);
  };
  std::array kinds{kind_of(tests.positions, aside(0), scaled[0]), kind_of(tests.control, aside(1), scaled[1])};
  const auto kind = [&](const PriorTest& test) -> PriorsOfKind& {
    return kinds[static_cast<std::size_t>(test.prior.is_control)];
  };
  PriorVerdicts change;
  for (const PriorTest& test : tests.aside)
    if (kind(test).agrees(test)) change.cleared.push_back(test.prior);
  if (!change.cleared.empty() || now.cleared.size() >= kMostCleared) return change;

  std::vector<PriorTest> gross;
  for (const PriorTest& test : tests.far_off)
    if (kind(test).far_off(test) && !holds(now.cleared, test.prior)) gross.push_back(test);
  std::ranges::sort(gross, [](const PriorTest& a, const PriorTest& b) {
    return a.sigmas != b.sigmas ? a.sigmas > b.sigmas : a.prior < b.prior;
  });
  for (const PriorTest& test : gross) {
    if (test.sigmas < kNearWorst * gross.front().sigmas) break;
    if (kind(test).room-- > 0) change.aside.push_back(test.prior);
  }
  return change;
}

void set_aside(const std::vector<PriorId>& priors, TileProblem& problem) { move_priors(priors, problem, true); }
void take_back(const std::vector<PriorId>& priors, TileProblem& problem) { move_priors(priors, problem, false); }

}  // namespace megablock
