// Gives tail probabilities of Fisher's distribution, for tests of several values at once.
//
// The ratio of two independent mean squares with d1 and d2 degrees of freedom exceeds v with the probability
// I_x(d2 / 2, d1 / 2) at x = d2 / (d2 + d1 v), where I is the regularised incomplete beta function. Boost.Math computes
// it.
#pragma once

namespace megablock {

// Returns the probability that a Fisher variable with these degrees of freedom (both > 0) exceeds `value`.
double fisher_exceeds(double value, double degrees, double degrees_below);

}  // namespace megablock
