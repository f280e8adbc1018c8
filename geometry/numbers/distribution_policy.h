// Sets how Boost.Math evaluates its distributions. Internal to geometry/numbers/.
//
// All arithmetic is double, which is fast and gives the same bits on every processor. An argument outside the domain
// gives NaN, and an overflow infinity, as the functions of <cmath> do; by default Boost.Math throws.
#pragma once

#include <boost/math/policies/policy.hpp>

namespace megablock {

using DistributionPolicy =
    boost::math::policies::policy<boost::math::policies::promote_double<false>,
                                  boost::math::policies::domain_error<boost::math::policies::ignore_error>,
                                  boost::math::policies::pole_error<boost::math::policies::ignore_error>,
                                  boost::math::policies::overflow_error<boost::math::policies::ignore_error>,
                                  boost::math::policies::evaluation_error<boost::math::policies::ignore_error>>;

}  // namespace megablock
