// Gives tail probabilities and quantiles of the normal distribution and of Student's distribution, for confidence
// limits of single values.
//
// The normal tail is erfc(v / sqrt 2) / 2. With d degrees of freedom, Student's tail is I_x(d / 2, 1 / 2) / 2 at
// x = d / (d + v^2), where I is the regularised incomplete beta function. Boost.Math computes both.
#pragma once

namespace megablock {

// Returns the probability that a standard normal variable exceeds `value`.
double normal_exceeds(double value);
// Returns the value that a standard normal variable exceeds with this probability, 0 < probability < 1.
double normal_quantile(double probability);

// Returns the probability that a Student variable with `degrees` degrees of freedom (> 0) exceeds `value`.
double student_exceeds(double value, double degrees);
// Returns the value that such a variable exceeds with this probability, 0 < probability < 1.
double student_quantile(double probability, double degrees);

}  // namespace megablock
