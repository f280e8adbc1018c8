// The normal distribution and Student's, by the complementary error function and the regularised incomplete beta
// function (continued fraction; Press et al., Numerical Recipes, 6.4).
#pragma once

namespace megablock {

// Probability that a standard normal variable is above `value`.
double normal_exceeds(double value);
// The value that it exceeds with this probability, 0 < probability < 1.
double normal_quantile(double probability);

// Probability that a variable of Student's distribution with these degrees of freedom (> 0) is above `value`.
double student_exceeds(double value, double degrees);
// The value that it exceeds with this probability, 0 < probability < 1.
double student_quantile(double probability, double degrees);

}  // namespace megablock
