// Computes the rational univariate representation (Rouillier 1999; M17). Let t be a linear form with a different value
// at each solution. Then f(t) = 0 and x_i = g_i(t) / g_1(t), where f is the characteristic polynomial of the
// multiplication by t:
//
//     f = sum a_i T^(D-i),   g_v = sum_i Tr(M_v M_t^i) H_(D-1-i),   H_j = sum_(i <= j) a_i T^(j-i).
#pragma once

#include "tests/algebra/ideal.h"

namespace megablock::algebra {

template <std::uint64_t P>
struct UnivariateForm {
  using Coefficients = std::vector<std::int64_t>;  // lifted, highest power first
  Coefficients polynomial, denominator;
  std::vector<Coefficients> numerators;  // [variables]
};

// All divided by `divisor`.
template <std::uint64_t P>
UnivariateForm<P> univariate_form(const Ideal<P>& ideal, const std::vector<std::int64_t>& form, std::int64_t divisor) {
  using Field = Modular<P>;
  using Matrix = std::vector<std::vector<std::uint64_t>>;
  const std::size_t size = ideal.standard().size();
  const auto product = [&](const Matrix& a, const Matrix& b) {
    Matrix c(size, std::vector<std::uint64_t>(size, 0));
    for (std::size_t i = 0; i < size; ++i)
      for (std::size_t k = 0; k < size; ++k)
        for (std::size_t j = 0; j < size; ++j) c[i][j] = Field::add(c[i][j], Field::times(a[i][k], b[k][j]));
    return c;
  };
  const auto trace = [&](const Matrix& a) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < size; ++i) sum = Field::add(sum, a[i][i]);
    return sum;
  };
  std::vector<Matrix> by_variable;
  Matrix one(size, std::vector<std::uint64_t>(size, 0)), by_form = one;
  for (std::size_t i = 0; i < size; ++i) one[i][i] = 1;
  for (std::size_t v = 0; v < form.size(); ++v) {
    by_variable.push_back(ideal.multiplication(static_cast<int>(v)));
    for (std::size_t i = 0; i < size; ++i)
      for (std::size_t j = 0; j < size; ++j)
        by_form[i][j] = Field::add(by_form[i][j], Field::times(Field::from(form[v]), by_variable[v][i][j]));
  }
  std::vector<Matrix> powers{one};
  for (std::size_t i = 0; i < size; ++i) powers.push_back(product(powers.back(), by_form));

  // Newton: k a_k = - sum_(i=1..k) a_(k-i) Tr(M_t^i).
  std::vector<std::uint64_t> a{1};
  for (std::size_t k = 1; k <= size; ++k) {
    std::uint64_t sum = 0;
    for (std::size_t i = 1; i <= k; ++i) sum = Field::add(sum, Field::times(a[k - i], trace(powers[i])));
    a.push_back(Field::times(Field::negative(sum), Field::inverse(k)));
  }
  const auto numerator = [&](const Matrix& by) {
    std::vector<std::uint64_t> g(size, 0);  // highest power, size - 1, first
    for (std::size_t i = 0; i < size; ++i) {
      const std::uint64_t factor = trace(product(by, powers[i]));
      for (std::size_t j = 0; j + i < size; ++j) g[i + j] = Field::add(g[i + j], Field::times(factor, a[j]));
    }
    std::vector<std::int64_t> lifted;
    for (const std::uint64_t c : g)
      lifted.push_back(Field::lift(Field::times(c, Field::inverse(Field::from(divisor)))));
    return lifted;
  };
  UnivariateForm<P> result;
  for (const std::uint64_t c : a) result.polynomial.push_back(Field::lift(c));
  result.denominator = numerator(one);
  for (const Matrix& by : by_variable) result.numerators.push_back(numerator(by));
  return result;
}

}  // namespace megablock::algebra
