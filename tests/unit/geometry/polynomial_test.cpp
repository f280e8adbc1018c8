#include "geometry/polynomial.h"

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
    const std::vector<double> roots = real_roots(product);
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

}  // namespace
}  // namespace megablock
