#include "geometry/numbers/student.h"

#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "geometry/numbers/distribution_policy.h"

namespace megablock {

namespace {
using Normal = boost::math::normal_distribution<double, DistributionPolicy>;
using Student = boost::math::students_t_distribution<double, DistributionPolicy>;
}  // namespace

double normal_exceeds(double value) { return cdf(complement(Normal(), value)); }

double normal_quantile(double probability) { return quantile(complement(Normal(), probability)); }

double student_exceeds(double value, double degrees) { return cdf(complement(Student(degrees), value)); }

double student_quantile(double probability, double degrees) {
  return quantile(complement(Student(degrees), probability));
}

}  // namespace megablock
