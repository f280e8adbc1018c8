// Polynomials of a degree known at compile time, and their real roots.
//
// Between two neighbouring extrema a polynomial has at most one root: the roots of the derivatives, from the last to
// the first, bracket those of the polynomial. Newton iterations kept inside the bracket by bisection find each.
//
// Only [-1, 1] is searched. Roots beyond are the inverses of those of the polynomial with its coefficients reversed,
// so that neither a root far out nor a leading coefficient near zero is a special case.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "geometry/numbers/solutions.h"

namespace megablock {

// c[0] + c[1] x + ... + c[Degree] x^Degree.
template <int Degree>
using Polynomial = std::array<double, static_cast<std::size_t>(Degree) + 1>;

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

double evaluate_polynomial(std::span<const double> coefficients, double x);

// A root x = numerator / denominator, the larger of which is one to a millionth; the denominator is not negative. A
// root at infinity has a denominator of zero.
struct ProjectiveRoot {
  double numerator = 0, denominator = 1;
};

namespace detail {

inline constexpr std::size_t kMaxDegree = 10;

// Roots in [low, high], ascending, into `roots`, which has room for the degree; how many.
std::size_t roots_within(std::span<const double> coefficients, double low, double high, double double_root,
                         double* roots);

}  // namespace detail

// In no particular order. An extremum within `double_root` of zero (against the sum of the terms' magnitudes) counts as
// a double root, given once: rounding decides whether it has two roots or none. None where a coefficient is not a
// number.
inline constexpr double kDoubleRoot = 1e-9;
template <std::size_t N>
Solutions<ProjectiveRoot, N - 1> projective_roots(const std::array<double, N>& c, double double_root = kDoubleRoot) {
  static_assert(N >= 2 && N - 1 <= detail::kMaxDegree);
  // The two searches part at a place where no structured problem has its roots (x = +-1: a turn by a right angle).
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

// The same, ascending and without those at infinity.
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
