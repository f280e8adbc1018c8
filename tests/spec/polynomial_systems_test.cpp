// Acceptance tests of the tool-box for polynomial systems (M15 to M18, M39), off-line: an oracle of its own over prime
// fields (tests/algebra).
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>

#include "geometry/numbers/decompositions.h"
#include "reached.h"
#include "tests/algebra/elimination_template.h"
#include "tests/algebra/systems.h"
#include "tests/algebra/univariate.h"

namespace megablock {
namespace {

constexpr std::uint64_t kPrime = 32003, kLargePrime = (std::uint64_t{1} << 61) - 1;
using Large = algebra::Polynomial<kLargePrime>;

// Sphere x^2 + y^2 + z^2 = 4, cylinder x^2 + z^2 = 3, cone x^2 + y^2 = z^2.
std::vector<Large> three_surfaces() {
  const Large x = Large::variable(0, 3), y = Large::variable(1, 3), z = Large::variable(2, 3);
  return {x * x + y * y + z * z - Large::constant(4, 3), x * x + z * z - Large::constant(3, 3), x * x + y * y - z * z};
}

TEST(Spec, AT01EigenvectorsOfTheActionMatrix) {
  const algebra::Ideal<kLargePrime> ideal(three_surfaces(), 3);
  ASSERT_EQ(ideal.standard().size(), 8u);
  EXPECT_EQ(ideal.leading(), (std::vector<algebra::Monomial>{{2, 0, 0}, {0, 2, 0}, {0, 0, 2}}));
  // Multiplication by a generic form; its transpose has the standard monomials at the solutions as eigenvectors.
  Eigen::Matrix<double, 8, 8> matrix = Eigen::Matrix<double, 8, 8>::Zero();
  const std::array<double, 3> form = {0.7, -1.9, 3.1};
  for (int v = 0; v < 3; ++v) {
    const auto by = ideal.multiplication(v);
    for (int i = 0; i < 8; ++i)
      for (int j = 0; j < 8; ++j)
        matrix(j, i) +=
            form[static_cast<std::size_t>(v)] * static_cast<double>(algebra::Modular<kLargePrime>::lift(
                                                    by[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]));
  }
  const std::optional<GeneralEigen> eigen = general_eigen(matrix);
  ASSERT_TRUE(eigen);
  const auto row_of = [&](int variable) {
    algebra::Monomial m(3, 0);
    m[static_cast<std::size_t>(variable)] = 1;
    const auto found = std::find(ideal.standard().begin(), ideal.standard().end(), m);
    return found - ideal.standard().begin();
  };
  double largest = 0;
  std::vector<int> found(8, 0);
  for (int k = 0; k < 8; ++k) {
    int which = 0;
    for (int v = 0; v < 3; ++v) {
      const std::complex<double> value = eigen->vectors(row_of(v), k) / eigen->vectors(0, k);
      const double size = v == 2 ? std::sqrt(2.0) : 1.0;
      keep_largest(largest, std::abs(value - (value.real() > 0 ? size : -size)));
      which = 2 * which + (value.real() > 0);
    }
    ++found[static_cast<std::size_t>(which)];
  }
  expect_at_most(largest, 1e-12, "largest error of a coordinate");
  EXPECT_EQ(found, std::vector<int>(8, 1));
}

TEST(Spec, AT01UnivariateRepresentation) {
  const algebra::Ideal<kLargePrime> ideal(three_surfaces(), 3);
  const auto form = algebra::univariate_form(ideal, {1, 2, 4}, 8);
  using Coefficients = std::vector<std::int64_t>;
  EXPECT_EQ(form.polynomial, (Coefficients{1, 0, -148, 0, 6902, 0, -113716, 0, 508369}));
  EXPECT_EQ(form.denominator, (Coefficients{1, 0, -111, 0, 3451, 0, -28429, 0}));
  EXPECT_EQ(form.numerators[0], (Coefficients{0, 1, 0, -39, 0, 171, 0, 24955}));
  EXPECT_EQ(form.numerators[1], (Coefficients{0, 2, 0, -90, 0, -1842, 0, 41354}));
  EXPECT_EQ(form.numerators[2], (Coefficients{0, 8, 0, -808, 0, 22200, 0, -154008}));
}

// Solutions of random systems over GF(32003): an instance tells the number of almost all.
TEST(Spec, AT02NumbersOfSolutions) {
  algebra::Systems<kPrime> systems(2);
  const auto count = [&](const auto& system, int variables, double expected, const char* what) {
    const algebra::Ideal<kPrime> ideal(system, variables);
    expect_within(static_cast<double>(ideal.standard().size()), expected, 0,
                  fmt::format("{} (degree {}), solutions", what, ideal.degree()));
  };
  count(systems.three_points_vertical(), 4, 8, "three points and the vertical");
  count(systems.three_points_vertical(true), 4, 12, "the same as printed, wrong");
  count(systems.similarity(), 4, 2, "similarity, seven equations");
  count(systems.five_points_thompson(), 6, 40, "five points, Thompson");
  count(systems.five_points_quaternion(), 7, 80, "five points, quaternion");
  count(systems.five_points_stereographic(), 6, 80, "five points, quaternion, stereographic base");
}

// Templates made with one instance eliminate others.
TEST(Spec, M18EliminationTemplates) {
  algebra::Systems<kPrime> systems(18);
  const auto make = [&](auto instance, const char* what) {
    const auto system = instance();
    const algebra::Ideal<kPrime> ideal(system, 4);
    const algebra::EliminationTemplate made = algebra::make_template(system, ideal, 4);
    std::printf("[ reached  ] %s: template of %zu x %zu, %zu solutions\n", what, made.rows.size(), made.columns.size(),
                ideal.standard().size());
    EXPECT_FALSE(made.rows.empty());
    for (int other = 0; other < 5; ++other) EXPECT_TRUE(algebra::eliminates(made, instance(), ideal.leading()));
    return made;
  };
  make([&] { return systems.three_points_vertical(); }, "three points and the vertical");
  make([&] { return systems.three_points_vertical(true); }, "the same as printed, wrong");
  const auto similarity = make([&] { return systems.similarity(); }, "similarity");
  expect_at_most(static_cast<double>(similarity.rows.size()), 24, "similarity, rows of the template");
  expect_at_most(static_cast<double>(similarity.columns.size()), 28, "similarity, columns");
}

// The template that the thesis prints for the similarity: six multiples of each equation, 28 monomials.
TEST(Spec, M18PublishedTemplateOfTheSimilarity) {
  algebra::Systems<kPrime> systems(50);
  algebra::EliminationTemplate published;
  for (std::size_t equation = 0; equation < 4; ++equation)
    for (int scale = 0; scale < 3; ++scale)
      for (int c = 0; c < 2; ++c) published.rows.push_back({{0, 0, c, scale}, equation});
  const auto system = systems.similarity();
  const algebra::Products<kPrime> products(system, published.rows, 4, 5);
  std::vector<std::size_t> all(published.rows.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  published.columns = products.columns(all);
  expect_within(static_cast<double>(published.rows.size()), 24, 0, "rows");
  expect_within(static_cast<double>(published.columns.size()), 28, 0, "columns");
  expect_within(static_cast<double>(products.independent().size()), 24, 0, "rank");
  const std::vector<algebra::Monomial> leading = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 2}};
  for (int instance = 0; instance < 5; ++instance)
    EXPECT_TRUE(algebra::eliminates(published, systems.similarity(), leading));
}

}  // namespace
}  // namespace megablock
