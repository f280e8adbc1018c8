#include "geometry/numbers/chi_square.h"

#include <boost/math/distributions/chi_squared.hpp>

#include "geometry/numbers/distribution_policy.h"

namespace megablock {

namespace {
using ChiSquare = boost::math::chi_squared_distribution<double, DistributionPolicy>;
}

double chi_square_exceeds(double statistic, double degrees) {
  if (statistic <= 0) return 1;
  return cdf(complement(ChiSquare(degrees), statistic));
}

double chi_square_quantile(double probability, std::int64_t degrees) {
  return quantile(complement(ChiSquare(static_cast<double>(degrees)), probability));
}

}  // namespace megablock
