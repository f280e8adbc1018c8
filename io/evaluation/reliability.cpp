#include "io/evaluation/reliability.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "geometry/numbers/student.h"
#include "io/base/error.h"

namespace megablock {

double normalised_residual(double residual, double sigma, double redundancy) {
  if (!(redundancy >= kLeastRedundancy)) return std::numeric_limits<double>::quiet_NaN();
  return std::abs(residual) / (sigma * std::sqrt(redundancy));
}

double tau_statistic(double normalised, double sigma_0) { return normalised / sigma_0; }

double normal_critical_value(double probability) { return normal_quantile(0.5 * probability); }

double tau_critical_value(std::int64_t degrees_of_freedom, double probability) {
  if (degrees_of_freedom < 1)
    throw ComputeError("no test of residuals with " + std::to_string(degrees_of_freedom) + " degrees of freedom");
  if (degrees_of_freedom == 1) return 1;
  const auto f = static_cast<double>(degrees_of_freedom);
  const double t = student_quantile(0.5 * probability, f - 1);
  return std::sqrt(f) / std::sqrt((f - 1) / (t * t) + 1);
}

double probability_of_one(std::int64_t count, double probability) {
  // 1 - (1 - p)^(1/n), without the cancellation for small p and large n.
  return -std::expm1(std::log1p(-probability) / static_cast<double>(std::max<std::int64_t>(1, count)));
}

// Both tails are counted. Baarda's nomograms neglect that w may exceed the critical value on the other side; the
// difference is 1e-13 here.
double least_shift(double false_alarm, double detection) {
  const double bound = normal_critical_value(false_alarm);
  // One tail alone gives bound + normal_quantile(1 - detection), which both tails can only lower. The probability grows
  // with the shift, so bisection finds it.
  double low = 0, high = bound + normal_quantile(1 - detection) + 1;
  for (int i = 0; i < 200 && high - low > 1e-15 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (normal_exceeds(bound - middle) + normal_exceeds(bound + middle) < detection ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double minimal_detectable_error(double sigma, double redundancy, double shift) {
  if (!(redundancy >= kLeastRedundancy)) return std::numeric_limits<double>::infinity();
  return shift * sigma / std::sqrt(redundancy);
}

double external_reliability(double redundancy, double shift) {
  if (!(redundancy >= kLeastRedundancy)) return std::numeric_limits<double>::infinity();
  return shift * std::sqrt(std::max(0.0, 1 - redundancy) / redundancy);
}

}  // namespace megablock
