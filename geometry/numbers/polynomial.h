// Multiplies polynomials whose degree is known at compile time, and finds all their real roots. Minimal solvers end in
// such a polynomial.
//
// Between two neighbouring extrema a polynomial is monotonic and has at most one root. So the roots of the derivatives,
// from the last derivative to the first, bracket the roots of the polynomial. Within a bracket Newton's iteration finds
// the root; bisection keeps it inside. In contrast to the eigenvalues of a companion matrix, this allocates nothing and
// computes only real roots.
//
// Only roots in [-1, 1] are searched for. A root x beyond is the inverse of a root of the polynomial with reversed
// coefficients, x^n p(1/x). Neither a very large root nor a leading coefficient near zero is then a special case.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "geometry/numbers/solutions.h"

namespace megablock {

// Coefficients in ascending order: c[0] + c[1] x + ... + c[Degree] x^Degree.
template <int Degree>
using Polynomial = std::array<double, static_cast<std::size_t>(Degree) + 1>;

// Product of two polynomials.
template <std::size_t A, std::size_t B>
constexpr std::array<double, A + B - 1> multiply(const std::array<double, A>& a, const std::array<double, B>& b) {
  std::array<double, A + B - 1> product{};
  for (std::size_t i = 0; i < A; ++i)
    for (std::size_t j = 0; j < B; ++j) product[i + j] += a[i] * b[j];
  return product;
}

// a + factor * b.
template <std::size_t N>
constexpr std::array<double, N> add(std::array<double, N> a, const std::array<double, N>& b, double factor = 1) {
  for (std::size_t i = 0; i < N; ++i) a[i] += factor * b[i];
  return a;
}

// The value at x. An empty list of coefficients gives 0.
double evaluate_polynomial(std::span<const double> coefficients, double x);

// A root x = numerator / denominator, in a form that also represents a root at infinity (denominator 0). The
// denominator is not negative. The larger absolute value of the two is 1, to about a millionth.
struct ProjectiveRoot {
  double numerator = 0, denominator = 1;
};

namespace detail {

inline constexpr std::size_t kMaxDegree = 10;

// Writes the roots in [low, high] into `roots`, ascending, and returns their number. `roots` must have room for as many
// as the degree.
std::size_t roots_within(std::span<const double> coefficients, double low, double high, double double_root,
                         double* roots);

}  // namespace detail

// Returns all real roots, in no particular order. Where an extremum is zero within `double_root` times the sum of the
// magnitudes of the terms, it counts as a double root and is returned once: rounding alone decides whether the computed
// polynomial has two roots there or none. Returns no roots where a coefficient is not a number.
inline constexpr double kDoubleRoot = 1e-9;
template <std::size_t N>
Solutions<ProjectiveRoot, N - 1> projective_roots(const std::array<double, N>& c, double double_root = kDoubleRoot) {
  static_assert(N >= 2 && N - 1 <= detail::kMaxDegree);
  // The two searches meet at |x| = 1 + 1e-6 rather than at 1, because structured problems often have a root exactly at
  // +-1 (a half-angle tangent of 1 is a right angle), which both searches could find or both could miss.
  constexpr double kParting = 1 + 1e-6;
  Solutions<ProjectiveRoot, N - 1> found;
  std::array<double, N - 1> roots;
  std::size_t count = detail::roots_within(c, -kParting, kParting, double_root, roots.data());
  for (std::size_t i = 0; i < count; ++i) found.push_back({roots[i], 1});
  std::array<double, N> reversed;
  std::reverse_copy(c.begin(), c.end(), reversed.begin());
  count = detail::roots_within(reversed, -1 / kParting, 1 / kParting, double_root, roots.data());
  for (std::size_t i = 0; i < count; ++i)
    found.push_back({roots[i] < 0 ? -1.0 : 1.0, roots[i] < 0 ? -roots[i] : roots[i]});
  return found;
}

// The finite real roots in ascending order.
template <std::size_t N>
Solutions<double, N - 1> real_roots(const std::array<double, N>& c) {
  std::array<double, N - 1> roots;
  std::size_t count = 0;
  for (const ProjectiveRoot& root : projective_roots(c))
    if (root.denominator > 0) roots[count++] = root.numerator / root.denominator;
  std::sort(roots.begin(), roots.begin() + count);
  Solutions<double, N - 1> found;
  for (std::size_t i = 0; i < count; ++i) found.push_back(roots[i]);
  return found;
}

}  // namespace megablock
