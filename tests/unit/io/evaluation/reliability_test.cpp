// Critical values against published tables, and all of them against simulated adjustments.
#include "io/evaluation/reliability.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

#include "geometry/numbers/student.h"
#include "io/base/error.h"
#include "io/report/sections/sections.h"

namespace megablock {
namespace {

// Baarda (1968): alpha_0 = 0.001 and beta_0 = 0.80 give k = 3.29, delta_0 = 4.13, lambda_0 = 17.05 (nomograms).
TEST(Reliability, ShiftOfBaarda) {
  EXPECT_NEAR(normal_critical_value(), 3.29, 5e-3);
  EXPECT_NEAR(least_shift(), 4.13, 5e-3);
  EXPECT_NEAR(least_shift() * least_shift(), 17.05, 0.05);
  EXPECT_NEAR(least_shift(0.01, 0.8), 3.42, 5e-3);
  EXPECT_NEAR(least_shift(0.05, 0.8), 2.80, 5e-3);
  EXPECT_NEAR(least_shift(0.001, 0.9), 4.57, 5e-3);
}

TEST(Reliability, NumbersOfOneObservation) {
  EXPECT_DOUBLE_EQ(normalised_residual(-1.5, 0.5, 0.25), 6);
  EXPECT_DOUBLE_EQ(tau_statistic(6, 1.5), 4);
  EXPECT_NEAR(minimal_detectable_error(0.5, 0.25), least_shift(), 1e-12);
  EXPECT_NEAR(external_reliability(0.5), least_shift(), 1e-12);
  EXPECT_DOUBLE_EQ(external_reliability(1), 0);
}

// Nothing checks it.
TEST(Reliability, OfAnObservationWithoutRedundancy) {
  for (const double redundancy : {0.0, -1e-9, std::nan("")}) {
    EXPECT_TRUE(std::isnan(normalised_residual(1, 1, redundancy)));
    EXPECT_EQ(minimal_detectable_error(1, redundancy), std::numeric_limits<double>::infinity());
    EXPECT_EQ(external_reliability(redundancy), std::numeric_limits<double>::infinity());
  }
}

// Few degrees of freedom have closed forms: tau^2 / f is a beta variable, uniform tau for three.
TEST(Reliability, TauOfFewDegrees) {
  for (const double p : {0.1, 0.05, 0.001}) {
    EXPECT_DOUBLE_EQ(tau_critical_value(1, p), 1);
    EXPECT_NEAR(tau_critical_value(2, p), std::sqrt(2.0) * std::cos(0.5 * M_PI * p), 1e-12);
    EXPECT_NEAR(tau_critical_value(3, p), std::sqrt(3.0) * (1 - p), 1e-12);
  }
  EXPECT_NEAR(tau_critical_value(1'000'000'000, 0.001), normal_critical_value(), 1e-7);
  EXPECT_THROW(tau_critical_value(0), ComputeError);
}

// Upper bounds of the largest standardised residual of a straight line through n points, tests at probability / n (Lund
// 1975; as in J. Appl. Math. 2021, 1478843, table 1).
TEST(Reliability, TauOfPublishedTables) {
  struct Bounds {
    std::int64_t n;
    double p10, p5, p1;
  };
  for (const Bounds& row :
       {Bounds{5, 1.6974, 1.7147, 1.7286}, Bounds{6, 1.8838, 1.9270, 1.9751}, Bounds{8, 2.1125, 2.1961, 2.3178},
        Bounds{10, 2.2562, 2.3643, 2.5407}, Bounds{20, 2.6126, 2.7651, 3.0575}, Bounds{30, 2.7869, 2.9516, 3.2812},
        Bounds{60, 3.0508, 3.2247, 3.5869}}) {
    const auto n = static_cast<double>(row.n);
    EXPECT_NEAR(tau_critical_value(row.n - 2, 0.10 / n), row.p10, 6e-5) << row.n;
    EXPECT_NEAR(tau_critical_value(row.n - 2, 0.05 / n), row.p5, 6e-5) << row.n;
    EXPECT_NEAR(tau_critical_value(row.n - 2, 0.01 / n), row.p1, 6e-5) << row.n;
  }
}

// Modified Thompson table: of one sample of n, with s = sqrt(sum v^2 / (n - 1)) and residuals that are not divided by
// sqrt(r) = sqrt((n - 1) / n).
TEST(Reliability, TauOfThompsonsTable) {
  const std::pair<std::int64_t, double> rows[] = {{3, 1.1511}, {4, 1.4250}, {5, 1.5712}, {10, 1.7984}};
  for (const auto& [n, value] : rows)
    EXPECT_NEAR(tau_critical_value(n - 1, 0.05) * std::sqrt((n - 1.0) / static_cast<double>(n)), value, 6e-5) << n;
}

TEST(Reliability, ProbabilityOfOneTest) {
  EXPECT_NEAR(std::pow(1 - probability_of_one(1000, 0.05), 1000), 0.95, 1e-12);
  EXPECT_NEAR(probability_of_one(1'000'000'000, 0.05), -std::log(0.95) / 1e9, 1e-18);
}

// A parabola through points of unequal weight: as often as they should, the tests raise a false alarm and find an error
// of the smallest detectable size, and it moves the result as far as stated.
TEST(Reliability, SimulatedAdjustments) {
  constexpr int kPoints = 9, kRuns = 40000, kWrong = 2;
  constexpr double kAlarm = 0.01, kFound = 0.8;
  Eigen::Matrix<double, kPoints, 3> a;
  Eigen::Matrix<double, kPoints, 1> sigma;
  for (int i = 0; i < kPoints; ++i) {
    const double t = 0.25 * i - 1;
    sigma[i] = i % 2 == 0 ? 0.5 : 2;
    a.row(i) << 1, t, t * t;
  }
  const Eigen::MatrixXd j = sigma.cwiseInverse().asDiagonal() * a;
  const Eigen::Matrix3d q = (j.transpose() * j).inverse();
  const Eigen::VectorXd redundancy = (1 - (j * q * j.transpose()).diagonal().array()).matrix();
  const double bound = normal_critical_value(kAlarm), tau_bound = tau_critical_value(kPoints - 3, kAlarm);
  const double error = minimal_detectable_error(sigma[kWrong], redundancy[kWrong], least_shift(kAlarm, kFound));
  std::mt19937_64 random(7);
  std::normal_distribution<double> gauss;
  double alarms = 0, tau_alarms = 0, found = 0;
  for (int run = 0; run < kRuns; ++run) {
    Eigen::VectorXd l(kPoints);  // divided by sigma; the true values are zero
    for (int i = 0; i < kPoints; ++i) l[i] = gauss(random);
    const auto residuals = [&](const Eigen::VectorXd& of) {
      return Eigen::VectorXd(of - j * (q * (j.transpose() * of)));
    };
    const Eigen::VectorXd v = residuals(l);
    const double sigma_0 = std::sqrt(v.squaredNorm() / (kPoints - 3));
    const double w = normalised_residual(v[kWrong] * sigma[kWrong], sigma[kWrong], redundancy[kWrong]);
    alarms += w > bound;
    tau_alarms += tau_statistic(w, sigma_0) > tau_bound;
    l[kWrong] += error / sigma[kWrong];
    found += normalised_residual(residuals(l)[kWrong] * sigma[kWrong], sigma[kWrong], redundancy[kWrong]) > bound;
  }
  const auto four_sigmas = [](double p) { return 4 * std::sqrt(p * (1 - p) / kRuns); };
  EXPECT_NEAR(alarms / kRuns, kAlarm, four_sigmas(kAlarm));
  EXPECT_NEAR(tau_alarms / kRuns, kAlarm, four_sigmas(kAlarm));
  EXPECT_NEAR(found / kRuns, kFound, four_sigmas(kFound));

  // The most it moves any function f'x, over the sigma of f'x: the length of Q^-1/2 dx.
  const Eigen::Vector3d moved = q * j.row(kWrong).transpose() * (error / sigma[kWrong]);
  EXPECT_NEAR(std::sqrt(moved.dot(q.inverse() * moved)),
              external_reliability(redundancy[kWrong], least_shift(kAlarm, kFound)), 1e-9);
}

}  // namespace
}  // namespace megablock
