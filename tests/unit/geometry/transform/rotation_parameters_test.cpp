// Cayley's and Thompson's parameters and the stereographic base, against their defining formulas.
#include "geometry/transform/rotation_parameters.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

TEST(RotationParameters, AreTheFormulasByWhichTheyAreDefined) {
  std::mt19937_64 random(71);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Quaterniond q = rotation_exp<double>(2.9 * random_direction(random));
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    const Eigen::Vector3d c = cayley_parameters(q);
    const Eigen::Matrix3d a = skew(c);
    const Eigen::Matrix3d cayley = (identity + a) * (identity - a).inverse();
    EXPECT_LT((cayley - q.toRotationMatrix()).norm(), 1e-12);
    // Thompson's matrix: R = ((1 - s) I + [v]x + v v' / 2) / (1 + s), s = |v|^2 / 4.
    const Eigen::Vector3d v = thompson_parameters(q);
    const double s = 0.25 * v.squaredNorm();
    const Eigen::Matrix3d thompson = ((1 - s) * identity + skew(v) + 0.5 * v * v.transpose()) / (1 + s);
    EXPECT_LT((thompson - q.toRotationMatrix()).norm(), 1e-12);
    EXPECT_LT(rotation_angle(rotation_from_cayley(c), q), 1e-12);
    EXPECT_LT(rotation_angle(rotation_from_thompson(v), q), 1e-12);
    const Eigen::Vector3d base = random_direction(random);
    EXPECT_LT((base_from_stereographic(stereographic_parameters(base)) - base).norm(), 1e-12);
  }
}

TEST(RotationParameters, HalfTurnsAndThePoleAreAtInfinity) {
  EXPECT_FALSE(cayley_parameters(Eigen::Quaterniond(0, 1, 0, 0)).allFinite());
  EXPECT_FALSE(stereographic_parameters({0, 0, 1}).allFinite());
}

}  // namespace
}  // namespace megablock
