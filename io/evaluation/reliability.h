// Gives the reliability of single observations: how large a gross error must be to be detected, and how much an
// undetected error can change the result (Baarda 1968, "A testing procedure for use in geodetic networks"; Pope 1976,
// "The statistics of residuals and the detection of outliers").
//
// Everything follows from the redundancy number r of the observation (observation_statistics.h), 0 <= r <= 1. It is the
// share of an error that appears in the observation's own residual. `sigma` is the sigma of the observation in the
// adjustment, in any unit; under a robust loss it is that of the weighted observation, sigma / sqrt(rho'). No other
// observation checks one with r < kLeastRedundancy; its normalised residual is then NaN, and its detectable error
// infinite.
//
// Derivation. With the design matrix A and weights P, the residuals are v = -R e for errors e, where R = I - A (A'P
// A)^-1 A'P and r = R_ii. For uncorrelated observations v has the variance sigma^2 r, and a gross error d of this
// observation moves v by r d, so it moves w = |v| / (sigma sqrt(r)) by d sqrt(r) / sigma. The test sees it if this
// shift reaches delta_0: d_0 = delta_0 sigma / sqrt(r). The part (1 - r) d_0 that the residual does not take goes into
// the unknowns. Over the sigma of any function of them it is at most delta_0 sqrt((1 - r) / r).
#pragma once

#include <cstdint>

namespace megablock {

inline constexpr double kLeastRedundancy = 1e-6;
// Baarda's choice: a test has a false alarm with a probability of 0.001, and detects the error with 0.8.
inline constexpr double kFalseAlarmProbability = 0.001, kDetectionProbability = 0.8;

// w = |v| / (sigma sqrt(r)). It has a standard normal distribution if sigma is true (Baarda's data snooping).
double normalised_residual(double residual, double sigma, double redundancy);
// Pope's statistic tau = w / sigma_0, where sigma_0 is the a-posteriori sigma of unit weight from the same residuals.
// It is at most sqrt(degrees of freedom).
double tau_statistic(double normalised, double sigma_0);

// The value that |w| exceeds with this probability: 3.29 for 0.001.
double normal_critical_value(double probability = kFalseAlarmProbability);
// The value that |tau| exceeds with this probability: sqrt(f) t / sqrt(f - 1 + t^2), with t from Student's distribution
// with f - 1 degrees of freedom at probability / 2. It is 1 for one degree of freedom. Throws ComputeError for fewer.
double tau_critical_value(std::int64_t degrees_of_freedom, double probability = kFalseAlarmProbability);
// The probability of a false alarm that each of `count` tests must have, so that all together raise one with
// `probability`.
double probability_of_one(std::int64_t count, double probability);

// delta_0: the distance of the expectation of w from 0 at which |w| exceeds its critical value with probability
// `detection`. It is 4.13 by default.
double least_shift(double false_alarm = kFalseAlarmProbability, double detection = kDetectionProbability);
// Internal reliability: the smallest error that is detected with this probability, delta_0 sigma / sqrt(r), in the unit
// of sigma.
double minimal_detectable_error(double sigma, double redundancy, double shift = least_shift());
// External reliability: the largest effect of such an error on any function of the unknowns, divided by the posterior
// sigma of the function, delta_0 sqrt((1 - r) / r).
double external_reliability(double redundancy, double shift = least_shift());

}  // namespace megablock
