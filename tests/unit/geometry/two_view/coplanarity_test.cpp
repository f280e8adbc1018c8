// The coplanarity determinant and the intersection of two rays, against their geometric meaning.
#include "geometry/two_view/coplanarity.h"

#include <gtest/gtest.h>

#include "geometry/intersection/two_rays.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

TEST(Coplanarity, AnglesAreThoseOfTheThreeTurns) {
  const XyzAngles a{0.3, -0.4, 2.5};
  const Eigen::Matrix3d x = Eigen::AngleAxisd(a.alpha, Eigen::Vector3d::UnitX()).toRotationMatrix(),
                        y = Eigen::AngleAxisd(a.beta, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                        z = Eigen::AngleAxisd(a.gamma, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_LT((rotation_from(a).toRotationMatrix() - z * y * x).norm(), 1e-15);
}

TEST(Coplanarity, IsTheDistanceOfTheRaysTimesTheirSine) {
  std::mt19937_64 random(51);
  for (int trial = 0; trial < 200; ++trial) {
    const double focal = 1500;
    const Eigen::Vector3d c1 = 100 * random_direction(random), c2 = 100 * random_direction(random);
    const XyzAngles a1 = xyz_angles(rotation_exp<double>(random_direction(random))),
                    a2 = xyz_angles(rotation_exp<double>(random_direction(random)));
    const Eigen::Vector2d m1 = 300 * random_direction(random).head<2>(), m2 = 300 * random_direction(random).head<2>();
    const double f = coplanarity_determinant(c2 - c1, focal, a1, m1, a2, m2).value;
    const Eigen::Vector3d d1 = rotation_from(a1).conjugate() * Eigen::Vector3d(m1.x() / focal, m1.y() / focal, 1);
    const Eigen::Vector3d d2 = rotation_from(a2).conjugate() * Eigen::Vector3d(m2.x() / focal, m2.y() / focal, 1);
    const Eigen::Vector3d normal = d1.cross(d2);
    EXPECT_NEAR(std::abs(f), std::abs((c2 - c1).dot(normal.normalized())) * normal.norm(), 1e-9);
  }
}

TEST(Coplanarity, NoBaseAndNumbersThatAreNone) {
  const XyzAngles a{3, 0.1, 0}, b{3.1, -0.1, 0.2};
  EXPECT_EQ(coplanarity_determinant(Eigen::Vector3d::Zero(), 1000, a, {1, 2}, b, {3, 4}).value, 0);
  EXPECT_TRUE(std::isnan(coplanarity_determinant({1, 0, 0}, 1000, a, {std::nan(""), 2}, b, {3, 4}).value));
}

TEST(TwoRays, MeetInTheMiddleOfTheirShortestDistance) {
  std::mt19937_64 random(52);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d far(652000, 6862000, 100), target = far + 10 * random_direction(random);
    const Eigen::Vector3d c1 = far + 100 * random_direction(random), c2 = far + 100 * random_direction(random);
    const Eigen::Vector3d d1 = (target - c1).normalized(), d2 = (target - c2).normalized();
    const Eigen::Vector3d across = d1.cross(d2).normalized();
    const auto exact = intersect_two_rays({c1, d1}, {c2, d2});
    ASSERT_TRUE(exact);
    EXPECT_LT((exact->position - target).norm(), 1e-7);
    EXPECT_LT(exact->miss, 1e-8);
    EXPECT_NEAR(exact->distance_first, (target - c1).norm(), 1e-6);
    EXPECT_NEAR(exact->distance_second, (target - c2).norm(), 1e-6);
    const auto apart = intersect_two_rays({c1 + 0.1 * across, d1}, {c2 - 0.1 * across, d2});
    ASSERT_TRUE(apart);
    EXPECT_LT((apart->position - target).norm(), 1e-7);
    EXPECT_NEAR(apart->miss, 0.2, 1e-8);
    const auto any = intersect_rays(std::vector<Ray>{{c1 + 0.1 * across, d1}, {c2 - 0.1 * across, d2}});
    ASSERT_TRUE(any);
    EXPECT_LT((apart->position - *any).norm(), 1e-6) << "as the intersection of any number of rays";
  }
}

TEST(TwoRays, NothingForRaysThatDoNotMeetInFront) {
  const Eigen::Vector3d o(0, 0, 0), x(1, 0, 0), z(0, 0, 1), slant = Eigen::Vector3d(-1, 0, 1).normalized();
  EXPECT_TRUE(intersect_two_rays({o, z}, {x, slant}));
  EXPECT_FALSE(intersect_two_rays({o, z}, {x, z})) << "parallel";
  EXPECT_FALSE(intersect_two_rays({o, z}, {o, z})) << "no base";
  EXPECT_FALSE(intersect_two_rays({o, z}, {o, slant})) << "no base";
  EXPECT_FALSE(intersect_two_rays({o, -z}, {x, -slant})) << "behind both";
  EXPECT_FALSE(intersect_two_rays({o, -z}, {x, slant})) << "behind one";
  EXPECT_FALSE(intersect_two_rays({o, z}, {x, Eigen::Vector3d::Constant(std::nan(""))}));
}

}  // namespace
}  // namespace megablock
