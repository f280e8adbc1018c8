#include "geometry/numbers/fisher.h"

#include <boost/math/distributions/fisher_f.hpp>

#include "geometry/numbers/distribution_policy.h"

namespace megablock {

double fisher_exceeds(double value, double degrees, double degrees_below) {
  using Fisher = boost::math::fisher_f_distribution<double, DistributionPolicy>;
  return cdf(complement(Fisher(degrees, degrees_below), value));
}

}  // namespace megablock
