#include "adjust/checks/prior_test.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

// A place that the rest of the block gives as zero with the information N, and an observation of it with a sigma of
// one: both together, and the test that follows.
struct ObservedPlace {
  Eigen::Matrix3d information;
  Eigen::Vector3d observed;
  double weight = 1;
  Eigen::Matrix3d covariance() const { return (information + weight * Eigen::Matrix3d::Identity()).inverse(); }
  Eigen::Vector3d adjusted() const { return covariance() * (weight * observed); }
  PriorTest test() const { return test_prior(adjusted() - observed, covariance(), weight); }
};

ObservedPlace random_place(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::Matrix3d factor;
  ObservedPlace place;
  for (double& value : factor.reshaped()) value = normal(random);
  for (double& value : place.observed) value = 10 * normal(random);
  place.information = factor * factor.transpose() + 0.01 * Eigen::Matrix3d::Identity();
  place.weight = std::uniform_real_distribution<double>(0.05, 1)(random);
  return place;
}

TEST(PriorTest, ComparesTheObservationWithTheBlockWithoutIt) {
  std::mt19937 random(1);
  for (int k = 0; k < 100; ++k) {
    const ObservedPlace place = random_place(random);
    // Without the observation the block is at zero.
    const Eigen::Matrix3d of_difference = Eigen::Matrix3d::Identity() + place.information.inverse();
    const double sigmas = std::sqrt(place.observed.dot(of_difference.inverse() * place.observed));
    const Eigen::Vector3d moved = place.adjusted();
    const double pull = std::sqrt(moved.dot(place.covariance().inverse() * moved));
    const PriorTest test = place.test();
    EXPECT_EQ(test.axes, 3);
    EXPECT_NEAR(test.sigmas, sigmas, 1e-9 * sigmas);
    EXPECT_NEAR(test.pull, pull, 1e-9 * pull);
  }
}

TEST(PriorTest, SaysNothingWhereNothingElseDeterminesTheBlock) {
  ObservedPlace place;
  place.information = Eigen::Vector3d(4, 4, 0).asDiagonal();
  place.observed = {3, 0, 1000};
  const PriorTest test = place.test();
  EXPECT_EQ(test.axes, 2);
  EXPECT_NEAR(test.sigmas, 3 / std::sqrt(1 + 0.25), 1e-9);
}

PriorTest control_test(std::int64_t row, double sigmas, double pull = 1) { return {{row, 1}, 3, sigmas, pull}; }

PriorTests tests_of(const std::vector<double>& sigmas) {
  PriorTests tests;
  for (std::size_t row = 0; row < sigmas.size(); ++row) {
    tests.control.add(sigmas[row] / 1.5382);
    if (sigmas[row] > 4) tests.far_off.push_back(control_test(static_cast<std::int64_t>(row), sigmas[row]));
  }
  return tests;
}
std::vector<PriorId> aside_of(const std::vector<double>& sigmas, const PriorVerdicts& now = {}, bool scaled = false) {
  return change_verdicts(tests_of(sigmas), now, {false, scaled}).aside;
}
PriorId control(std::int64_t row) { return {row, 1}; }

TEST(PriorTest, TheWorstIsSetAsideAndNotItsNeighbours) {
  EXPECT_EQ(aside_of({1, 2, 20, 19, 1, 1.5}), std::vector{control(2)});
  std::vector<double> many(100, 1.5);
  many[7] = 20;
  many[8] = 19;
  many[9] = 9;
  EXPECT_EQ(aside_of(many), (std::vector{control(7), control(8)}));
}

// The loss ignores a position that is far off, but for a little. It is worth another adjustment of a small block.
TEST(PriorTest, AFewPositionsArePulledByNone) {
  const auto aside_of_positions = [](int count, std::int64_t is_control, double pull) {
    PriorTests tests;
    for (int i = 0; i < count; ++i) (is_control ? tests.control : tests.positions).add(1);
    tests.far_off.push_back({{3, is_control}, 3, 50, pull});
    return change_verdicts(tests, {}, {false, false}).aside.size();
  };
  EXPECT_EQ(aside_of_positions(18, 0, 0.1), 1U);
  EXPECT_EQ(aside_of_positions(18, 0, 0.01), 0U);
  EXPECT_EQ(aside_of_positions(60, 0, 0.1), 0U);
  EXPECT_EQ(aside_of_positions(60, 0, 0.4), 1U);
  EXPECT_EQ(aside_of_positions(18, 1, 0.1), 0U);
}

// P(chi > 4.5) = 1.5e-4 for three normal deviates.
TEST(PriorTest, TheLimitGrowsWithTheNumberOfObservations) {
  std::vector<double> few(20, 1.5), many(200, 1.5);
  few[3] = many[3] = 4.5;
  EXPECT_EQ(aside_of(few), std::vector{control(3)});
  EXPECT_TRUE(aside_of(many).empty());
}

TEST(PriorTest, SigmasThatAreTooSmallMakeNoGrossErrors) {
  std::vector<double> lengths(50, 4.5);
  lengths[3] = 12;
  EXPECT_TRUE(aside_of(lengths).empty());
  lengths[3] = 16;
  EXPECT_EQ(aside_of(lengths), std::vector{control(3)});
  // Estimated ones may be a quarter too small.
  EXPECT_EQ(aside_of({1, 2, 4.5, 1, 1, 1.5}), std::vector{control(2)});
  EXPECT_TRUE(aside_of({1, 2, 4.5, 1, 1, 1.5}, {}, true).empty());
}

TEST(PriorTest, AtMostAFifthOfAKindIsSetAside) {
  EXPECT_TRUE(aside_of({1, 20, 1, 1}).empty()) << "four points do not tell which of them is wrong";
  const std::vector<double> wrong{20, 19, 18, 1, 1, 1, 1, 1, 1};
  EXPECT_EQ(aside_of(wrong, {{control(20)}, {}}), std::vector{control(0)});
  EXPECT_TRUE(aside_of(wrong, {{control(20), control(21), control(22)}, {}}).empty());
}

// Among few points a gross error spreads to all, and the worst may be a good one.
TEST(PriorTest, AnObservationComesBackThatAgreesWithTheBlockWithoutIt) {
  PriorTests tests = tests_of({1, 2, 6, 1, 1.5});
  tests.aside = {control_test(8, 2)};
  const PriorVerdicts back = change_verdicts(tests, {{control(8)}, {}}, {});
  EXPECT_EQ(back.cleared, std::vector{control(8)});
  EXPECT_TRUE(back.aside.empty()) << "the block is first adjusted with it";
  tests.aside = {control_test(8, 6)};
  EXPECT_TRUE(change_verdicts(tests, {{control(8)}, {}}, {}).cleared.empty());
  tests.aside.front() = {control(8), 0, 0, 0};  // not tested
  EXPECT_TRUE(change_verdicts(tests, {{control(8)}, {}}, {}).cleared.empty());
  EXPECT_TRUE(aside_of({1, 2, 6, 1, 1.5}, {{}, {control(2)}}).empty()) << "it was tried before";
}

// The tests of a tile at its true poses, with the covariance of a block that is known twice as well as its
// observations.
PriorTests known_well(const SingleTile& tile) {
  const auto of = [&](const std::vector<TileProblem::PositionTerm>& terms) {
    std::vector<Eigen::Matrix3d> covariances;
    for (const auto& term : terms) {
      const auto frame = static_cast<std::size_t>(term.frame.value);
      const auto by_frame = linearise_position(tile.truth().frames[frame], term.prior).by_frame;
      covariances.emplace_back(0.002 * by_frame * by_frame.transpose());
    }
    return covariances;
  };
  const auto positions = of(tile.problem.positions), positions_aside = of(tile.problem.positions_aside);
  const std::vector<Eigen::Matrix3d> points(tile.problem.points.size(), 0.002 * Eigen::Matrix3d::Identity());
  return test_priors(tile.problem, tile.truth(), {positions, positions_aside, points});
}

TEST(PriorTest, TestsWhatATileOwnsAndTakesItOut) {
  SimulationOptions simulation;
  simulation.frames = 12;
  simulation.gps_sigma_m = 0.1;
  simulation.control_points = 6;
  simulation.control_sigma_m = 0.1;
  SingleTile tile(simulation);
  constexpr std::size_t kWrongFrame = 4, kWrongPoint = 2;
  tile.problem.positions[kWrongFrame].prior.position.x() += 1;
  tile.problem.point_priors[kWrongPoint].position.y() += 1;
  const std::int64_t frame =
      tile.problem.frames[static_cast<std::size_t>(tile.problem.positions[kWrongFrame].frame.value)].value;
  const auto point = static_cast<std::size_t>(tile.problem.point_priors[kWrongPoint].point.value);
  const std::int64_t row = tile.problem.points[point].index;
  const TileProblem problem = tile.problem;
  const TileProblem::PositionTerm wrong = problem.positions[kWrongFrame];
  const PriorTests tests = known_well(tile);
  EXPECT_EQ(tests.positions.total(), 12);
  EXPECT_EQ(tests.control.total(), 6);
  ASSERT_EQ(tests.far_off.size(), 2u);
  EXPECT_EQ(tests.far_off[0].prior, (PriorId{frame, 0}));
  EXPECT_EQ(tests.far_off[1].prior, (PriorId{row, 1}));
  const std::vector<PriorId> both{tests.far_off[0].prior, tests.far_off[1].prior};
  set_aside(both, tile.problem);
  EXPECT_EQ(tile.problem.positions.size(), 11u);
  EXPECT_EQ(tile.problem.point_priors.size(), 5u);
  EXPECT_EQ(tile.problem.points[point].role, PointRole::kCheck);
  const PriorTests without = known_well(tile);
  EXPECT_EQ(without.positions.total(), 11);
  EXPECT_TRUE(without.far_off.empty());
  ASSERT_EQ(without.aside.size(), 2u);
  // The block is as it was, and its covariance is that with the observation: d is r, and cov(d) is I + Q.
  const FrameResidual3 r =
      linearise_position(tile.truth().frames[static_cast<std::size_t>(wrong.frame.value)], wrong.prior);
  const Eigen::Matrix3d of_difference = Eigen::Matrix3d::Identity() + 0.002 * r.by_frame * r.by_frame.transpose();
  EXPECT_NEAR(without.aside[0].sigmas, std::sqrt(r.residual.dot(of_difference.inverse() * r.residual)), 1e-9);
  take_back(both, tile.problem);
  EXPECT_EQ(tile.problem.positions.size(), 12u);
  EXPECT_EQ(tile.problem.positions[kWrongFrame].frame, problem.positions[kWrongFrame].frame);
  EXPECT_EQ(tile.problem.point_priors[kWrongPoint].point, problem.point_priors[kWrongPoint].point);
  EXPECT_EQ(tile.problem.points[point].role, PointRole::kControl);
}

}  // namespace
}  // namespace megablock
