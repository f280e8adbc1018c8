// Polynomials of a degree known at compile time, and their real roots.
//
// Between two neighbouring extrema a polynomial has at most one root: the roots of the derivatives, from the last to
// the first, bracket those of the polynomial. Newton iterations kept inside the bracket by bisection find each.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace megablock {

// c[0] + c[1] x + ... + c[Degree] x^Degree.
template <int Degree>
using Polynomial = std::array<double, static_cast<std::size_t>(Degree) + 1>;

template <std::size_t A, std::size_t B>
std::array<double, A + B - 1> multiply(const std::array<double, A>& a, const std::array<double, B>& b) {
  std::array<double, A + B - 1> product{};
  for (std::size_t i = 0; i < A; ++i)
    for (std::size_t j = 0; j < B; ++j) product[i + j] += a[i] * b[j];
  return product;
}

// a + factor * b.
template <std::size_t N>
std::array<double, N> add(std::array<double, N> a, const std::array<double, N>& b, double factor = 1) {
  for (std::size_t i = 0; i < N; ++i) a[i] += factor * b[i];
  return a;
}

double evaluate_polynomial(std::span<const double> coefficients, double x);

// Ascending. An extremum within 1e-9 of zero (against the sum of the terms' magnitudes) counts as a double root, given
// once: rounding decides whether it has two roots or none. Empty when the leading coefficient vanishes against the
// others.
std::vector<double> real_roots(std::span<const double> coefficients);

}  // namespace megablock
