// The five-point solver: the truth is among the solutions, every solution fulfils the equations, and structured scenes
// and double roots are found as well.
#include "geometry/two_view/five_point.h"

#include <gtest/gtest.h>

#include "geometry/numbers/median.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

PairScene five_of(const PairSceneOptions& options, std::mt19937_64& random) { return PairScene(options, 5, random); }

TEST(FivePoint, FindsTheTruthAndOnlySolutions) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int trial = 0; trial < 500; ++trial) {
    PairSceneOptions options;
    options.rotation = rotation_exp<double>(3.1 * uniform(random) * random_direction(random));
    options.base = 0.5 * uniform(random) * random_direction(random);
    const PairScene scene = five_of(options, random);
    const FiveRays a = scene.first<5>(scene.a), b = scene.first<5>(scene.b);
    const auto all = solve_five_point(a, b);
    EXPECT_EQ(all.size() % 4, 0u);
    EXPECT_LT(nearest_error_deg(all, scene.truth), 1e-4);
    for (const RelativeOrientation& o : all)
      for (std::size_t i = 0; i < 5; ++i) EXPECT_LT(std::abs(b[i].dot(essential_from(o) * a[i])), 1e-12);
    const auto front = solve_five_point_in_front(a, b);
    EXPECT_LT(nearest_error_deg(front, scene.truth), 1e-4);
    std::size_t in_front = 0;
    for (const RelativeOrientation& o : all) in_front += all_in_front(o, a, b);
    EXPECT_EQ(front.size(), in_front);
  }
}

TEST(FivePoint, StructuredScenesAreNoSpecialCase) {
  std::mt19937_64 random(12);
  for (const Eigen::Vector3d& base :
       {Eigen::Vector3d(0.3, 0, 0), Eigen::Vector3d(0, 0.3, 0), Eigen::Vector3d(0, 0, 0.3)}) {
    for (const double half_turn : {0.0, std::numbers::pi}) {
      for (const bool plane : {false, true}) {
        PairSceneOptions options;
        options.rotation = rotation_exp<double>({0, 0, half_turn});
        options.base = base;
        options.plane = plane;
        // A base along the plane's normal is a double root: half of the digits are lost, and a few samples have no
        // solution.
        const bool double_root = plane && base.z() > 0;
        int missed = 0;
        for (int trial = 0; trial < 100; ++trial) {
          const PairScene scene = five_of(options, random);
          const auto found = solve_five_point_in_front(scene.first<5>(scene.a), scene.first<5>(scene.b));
          missed += !(nearest_error_deg(found, scene.truth) < (double_root ? 1e-2 : 1e-5));
        }
        EXPECT_LE(missed, double_root ? 5 : 0) << base.transpose() << (plane ? ", plane" : "");
      }
    }
  }
}

// With Newton steps of the usual length, the iterations would end at about 1e-5 degrees.
TEST(FivePoint, DoubleRootsAreReached) {
  std::mt19937_64 random(14);
  PairSceneOptions options;
  options.base = {0, 0, 0.3};
  options.plane = true;
  std::vector<double> errors;
  for (int trial = 0; trial < 200; ++trial) {
    const PairScene scene = five_of(options, random);
    errors.push_back(
        nearest_error_deg(solve_five_point(scene.first<5>(scene.a), scene.first<5>(scene.b)), scene.truth));
  }
  EXPECT_LT(median(std::move(errors)), 1e-7);
}

TEST(FivePoint, NothingForBadPoints) {
  std::mt19937_64 random(13);
  const PairScene scene = five_of({}, random);
  const FiveRays a = scene.first<5>(scene.a), b = scene.first<5>(scene.b);
  FiveRays bad_a = a, bad_b = b;
  bad_a[3].z() = std::nan("");
  EXPECT_TRUE(solve_five_point(bad_a, b).empty());
  bad_a[3] = a[0];
  bad_b[3] = b[0];
  EXPECT_TRUE(solve_five_point(bad_a, bad_b).empty()) << "two points are one";
  for (std::size_t i = 0; i < 5; ++i) {
    const Eigen::Vector3d point =
        Eigen::Vector3d(-0.5, 0.1, 2) + static_cast<double>(i) * Eigen::Vector3d(0.2, 0.1, 0.1);
    bad_a[i] = point.normalized();
    bad_b[i] = (point + Eigen::Vector3d(0.3, 0, 0)).normalized();
  }
  EXPECT_TRUE(solve_five_point(bad_a, bad_b).empty()) << "all on one line";
  bad_b = b;
  bad_b[2] = -bad_b[2];
  EXPECT_GT(nearest_error_deg(solve_five_point_in_front(a, bad_b), scene.truth), 1e-3) << "a point behind";
  // Without a base every solution fulfils the equations; nothing more can be tested.
  for (const RelativeOrientation& o : solve_five_point(a, a))
    for (std::size_t i = 0; i < 5; ++i) EXPECT_LT(std::abs(a[i].dot(essential_from(o) * a[i])), 1e-12);
}

TEST(RelativeOrientation, FourOrientationsOfAnEssentialMatrix) {
  std::mt19937_64 random(14);
  for (int trial = 0; trial < 100; ++trial) {
    const RelativeOrientation truth{rotation_exp<double>(2 * random_direction(random)), random_direction(random)};
    const Eigen::Matrix3d essential = -3 * essential_from(truth);
    const auto all = orientations_of_essential(essential);
    ASSERT_EQ(all.size(), 4u);
    EXPECT_LT(nearest_error_deg(all, truth), 1e-10);
    for (const RelativeOrientation& o : all) {
      const double same =
          std::min((essential_from(o) - essential / 3).norm(), (essential_from(o) + essential / 3).norm());
      EXPECT_LT(same, 1e-12);
    }
    const Eigen::Matrix3d noise = 0.01 * random_direction(random) * random_direction(random).transpose();
    const Eigen::Matrix3d nearest = nearest_essential(essential + noise);
    EXPECT_NEAR(nearest.determinant(), 0, 1e-15);
    EXPECT_LT((2 * nearest * nearest.transpose() * nearest - nearest).norm(), 1e-14);
    EXPECT_LT(nearest_error_deg(orientations_of_essential(nearest), truth), 1);
  }
  EXPECT_TRUE(orientations_of_essential(Eigen::Matrix3d::Zero()).empty());
  EXPECT_TRUE(orientations_of_essential(Eigen::Matrix3d::Constant(std::nan(""))).empty());
}

TEST(RelativeOrientation, ChoosesThePhysicalSolution) {
  std::mt19937_64 random(15);
  PairSceneOptions options;
  options.rotation = rotation_exp<double>({0.05, -0.1, 0.2});
  options.noise_px = 0.3;
  int chosen_right = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const PairScene scene(options, 200, random);
    const auto candidates = orientations_of_essential(essential_from(scene.truth));
    const auto chosen = choose_orientation(candidates, scene.a, scene.b, {2 / kSceneFocalPx, 1});
    ASSERT_TRUE(chosen);
    chosen_right += nearest_error_deg(std::array{chosen->orientation}, scene.truth) < 1e-6;
    EXPECT_EQ(chosen->inliers, 200);
    EXPECT_FALSE(chosen->twin);
  }
  EXPECT_EQ(chosen_right, 50);
  EXPECT_FALSE(choose_orientation({}, {}, {}, {}));
}

}  // namespace
}  // namespace megablock
