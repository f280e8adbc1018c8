// Roots of polynomials that are multiplied from known factors: several, double, very large, infinite and at zero.
#include "geometry/numbers/polynomial.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace megablock {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(Polynomial, RootsOfAProductOfFactors) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-3, 3);
  for (int trial = 0; trial < 200; ++trial) {
    // Six real roots and a complex pair.
    std::vector<double> truth(6);
    for (double& root : truth) root = uniform(random);
    std::sort(truth.begin(), truth.end());
    bool close = false;
    for (std::size_t i = 1; i < truth.size(); ++i) close |= truth[i] - truth[i - 1] < 0.02;
    if (close) continue;
    const double centre = uniform(random);
    Polynomial<2> pair{centre * centre + 0.5, -2 * centre, 1};
    const auto factor = [&](std::size_t i) { return Polynomial<1>{-truth[i], 1}; };
    const Polynomial<8> product =
        multiply(multiply(multiply(multiply(factor(0), factor(1)), multiply(factor(2), factor(3))),
                          multiply(factor(4), factor(5))),
                 pair);
    const auto roots = real_roots(product);
    ASSERT_EQ(roots.size(), truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) EXPECT_NEAR(roots[i], truth[i], 1e-7);
  }
}

TEST(Polynomial, DoubleRootOnceNoneWhereThereIsNone) {
  EXPECT_THAT(real_roots(Polynomial<2>{1, -2, 1}), ElementsAre(DoubleNear(1, 1e-7)));
  EXPECT_THAT(real_roots(Polynomial<2>{1, 0, 1}), IsEmpty());
  EXPECT_THAT(real_roots(Polynomial<3>{0, 0, 0, 2}), ElementsAre(DoubleNear(0, 1e-5)));
  EXPECT_THAT(real_roots(Polynomial<1>{3, 0}), IsEmpty()) << "no leading coefficient";
}

TEST(Polynomial, RootsFarOutAndAtInfinityAreFound) {
  // (x - 1e9)(x + 1e-9)(x - 1)(x + 1)(x - 3), without and with two roots at infinity.
  const Polynomial<5> product =
      multiply(multiply(Polynomial<1>{-1e9, 1}, Polynomial<1>{1e-9, 1}),
               multiply(multiply(Polynomial<1>{-1, 1}, Polynomial<1>{1, 1}), Polynomial<1>{-3, 1}));
  const std::array<double, 5> truth = {-1, -1e-9, 1, 3, 1e9};
  const auto roots = real_roots(product);
  ASSERT_EQ(roots.size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) EXPECT_NEAR(roots[i] / truth[i], 1, 1e-9);
  Polynomial<7> longer{};
  std::copy(product.begin(), product.end(), longer.begin());
  EXPECT_EQ(real_roots(longer).size(), truth.size());
  bool infinite = false;
  for (const ProjectiveRoot& root : projective_roots(longer)) infinite |= std::abs(root.denominator) < 1e-6;
  EXPECT_TRUE(infinite);
}

TEST(Polynomial, DoubleRootAtZeroThatRoundingHasBlurred) {
  EXPECT_THAT(real_roots(Polynomial<4>{3e-20, -4e-19, -2e-4, -0.01, 2e-4}), testing::Contains(DoubleNear(0, 1e-6)));
}

TEST(Polynomial, NothingOfWhatIsNoNumber) {
  EXPECT_TRUE(real_roots(Polynomial<3>{1, std::nan(""), 2, 1}).empty());
  EXPECT_TRUE(real_roots(Polynomial<3>{}).empty());
}

}  // namespace
}  // namespace megablock
