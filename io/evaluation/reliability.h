// Reliability of single observations: which gross errors the others would show, and what those that they would not show
// do to the result (Baarda 1968, "A testing procedure for use in geodetic networks"; Pope 1976, "The statistics of
// residuals and the detection of outliers").
//
// Everything follows from the redundancy number r of the observation (observation_statistics.h), 0 <= r <= 1: the share
// of an error that shows in its own residual. `sigma` is that of the observation in the adjustment, in any unit; under
// a robust loss that of the weighted observation, sigma / sqrt(rho'). An observation with less than kLeastRedundancy is
// not checked by any other: what divides by r is NaN for residuals and infinite for errors.
#pragma once

#include <cstdint>

namespace megablock {

inline constexpr double kLeastRedundancy = 1e-6;
// Baarda's choice: an error is looked for with a probability of 0.001 of a false alarm and to be found with 0.8.
inline constexpr double kFalseAlarmProbability = 0.001, kDetectionProbability = 0.8;

// w = |v| / (sigma sqrt(r)): of a standard normal distribution where sigma is true (Baarda's data snooping).
double normalised_residual(double residual, double sigma, double redundancy);
// tau = w / sigma_0, sigma_0 the a-posteriori sigma of unit weight of the same residuals: Pope's statistic, at most
// sqrt(degrees of freedom).
double tau_statistic(double normalised, double sigma_0);

// |w| is above it with this probability: 3.29 for 0.001.
double normal_critical_value(double probability = kFalseAlarmProbability);
// |tau| is above it with this probability: sqrt(f) t / sqrt(f - 1 + t^2), t of Student's distribution with f - 1
// degrees of freedom at probability / 2. One degree of freedom: 1. InputError for fewer.
double tau_critical_value(std::int64_t degrees_of_freedom, double probability = kFalseAlarmProbability);
// Probability for each of `count` tests at which all together raise a false alarm with `probability`.
double probability_of_one(std::int64_t count, double probability);

// delta_0: how far the expectation of w must lie from 0 for |w| to exceed its critical value with `detection`; 4.13.
double least_shift(double false_alarm = kFalseAlarmProbability, double detection = kDetectionProbability);
// Internal reliability: the smallest error found so, in the unit of sigma: delta_0 sigma / sqrt(r).
double minimal_detectable_error(double sigma, double redundancy, double shift = least_shift());
// External reliability: how far such an error moves any function of the unknowns at most, over that function's
// posterior sigma: delta_0 sqrt((1 - r) / r).
double external_reliability(double redundancy, double shift = least_shift());

}  // namespace megablock
