#include "adjust/coplanarity/coplanarity_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "io/base/error.h"

namespace megablock {
namespace {

constexpr double kFocalPx = 1000;

// Cameras that look along +z of the ground.
CoplanarityNetwork looking_up(const std::vector<Eigen::Vector3d>& centres) {
  CoplanarityNetwork network;
  network.focal_px = kFocalPx;
  network.centres = centres;
  network.angles.resize(centres.size());
  return network;
}
void see(CoplanarityNetwork& network, const Eigen::Vector3d& point, const std::vector<std::int32_t>& cameras) {
  for (const std::int32_t camera : cameras) {
    network.camera.push_back(camera);
    const Eigen::Vector3d inside = point - network.centres[static_cast<std::size_t>(camera)];
    network.image.emplace_back(kFocalPx * inside.hnormalized());
  }
  network.begin.push_back(std::ssize(network.camera));
}
Eigen::Vector3d ground_point(int i) { return {8.0 * (i % 5) - 16, 9.0 * ((2 * i) % 7) - 27, 3.0 * (i % 3)}; }

CoplanarityNetwork four_cameras() {
  CoplanarityNetwork network = looking_up({{-20, -15, -50}, {25, -10, -60}, {18, 22, -55}, {-15, 20, -70}});
  for (int i = 0; i < 12; ++i) see(network, ground_point(i), {0, 1, 2, 3});
  return network;
}

TEST(CoplanarityDiagnosis, LeavesOutPointsWhoseRaysDoNotMeetInFront) {
  const CoplanarityNetwork good = four_cameras();
  CoplanarityNetwork behind = good;
  see(behind, {1, 2, -150}, {0, 1, 2, 3});
  const CoplanarityDiagnosis expected = diagnose(good), found = diagnose(behind);
  EXPECT_EQ(found.angle_values, expected.angle_values);
  EXPECT_EQ(found.rank, expected.rank);

  // Rays far off the axes that pass each other at (10, 0): the point nearest to both is ahead along the rays, at the
  // height 0.75, and behind the second camera at 0.9.
  CoplanarityNetwork level = looking_up({{0, 0, 0}, {0, 10, 0.9}});
  see(level, {5, 5, 50}, {0, 1});
  const CoplanarityDiagnosis alone = diagnose(level);
  level.camera.insert(level.camera.end(), {0, 1});
  level.image.emplace_back(20 * kFocalPx, 0);
  level.image.emplace_back(100 * kFocalPx, -100 * kFocalPx);
  level.begin.push_back(4);
  EXPECT_EQ(diagnose(level).angle_values, alone.angle_values);
}

TEST(CoplanaritySolution, IsDeficientUnlessAllThatIsFreeIsForcedOrDetermined) {
  CoplanarityNetwork network = four_cameras();
  for (XyzAngles& angles : network.angles) angles.alpha += 1e-5;
  CoplanarityOptions options;
  options.forcing_angles = 0.02;
  const CoplanaritySolution images_open = adjust_by_coplanarity(network, options);
  EXPECT_TRUE(images_open.rank_deficient);
  EXPECT_EQ(images_open.open_directions, 3 * 12);
  EXPECT_THAT(images_open.remarks(), testing::Contains(testing::HasSubstr("rank-deficient")));
  options.solver = CoplanarityOptions::Solver::kDirect;
  EXPECT_THROW(adjust_by_coplanarity(network, options), ComputeError);
  options.forcing_images = 0.02;
  EXPECT_FALSE(adjust_by_coplanarity(network, options).rank_deficient);
  options.forcing_angles = 0;  // the images are forced, and the angles follow from them
  EXPECT_FALSE(adjust_by_coplanarity(network, options).rank_deficient);
  options.forcing_images = 0;
  network.images_held.assign(2 * network.image.size(), 1);
  EXPECT_FALSE(adjust_by_coplanarity(network, options).rank_deficient);
}

TEST(CoplanaritySolution, SaysThatTheDeterminantsHaveGrown) {
  CoplanaritySolution found;
  found.mean_before = 3;
  found.mean_after = 2.9;
  EXPECT_TRUE(found.remarks().empty());
  found.mean_after = 3.1;
  EXPECT_THAT(found.remarks(), testing::ElementsAre(testing::HasSubstr("have grown")));
  found.rounding = 0.2;
  EXPECT_TRUE(found.remarks().empty());
}

// Exact rays: what their determinants are before and after is rounding, one as much as the other.
TEST(CoplanaritySolution, RoundingIsNoGrowth) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int grown = 0;
  for (int trial = 0; trial < 100; ++trial) {
    CoplanarityNetwork network;
    network.focal_px = kFocalPx;
    for (int i = 0; i < 4; ++i) {
      const double x = 30 * uniform(random), y = 30 * uniform(random), z = -60 + 10 * uniform(random);
      network.centres.emplace_back(x, y, z);
      const double alpha = 0.5 * uniform(random), beta = 0.5 * uniform(random), gamma = 3 * uniform(random);
      network.angles.push_back({alpha, beta, gamma});
    }
    for (int i = 0; i < 12; ++i) {
      for (std::int32_t camera = 0; camera < 4; ++camera) {
        const auto c = static_cast<std::size_t>(camera);
        network.camera.push_back(camera);
        network.image.emplace_back(
            kFocalPx * (rotation_from(network.angles[c]) * (ground_point(i) - network.centres[c])).hnormalized());
      }
      network.begin.push_back(std::ssize(network.camera));
    }
    network.images_held.assign(2 * network.image.size(), 1);
    CoplanarityOptions options;
    options.solver = CoplanarityOptions::Solver::kDirect;
    const CoplanaritySolution found = adjust_by_coplanarity(network, options);
    EXPECT_LE(found.mean_before, found.rounding);
    EXPECT_LT(found.rounding, 1e-12) << "m, of bases of up to 85 m";
    grown += found.mean_after > found.mean_before;
    EXPECT_THAT(found.remarks(), testing::IsEmpty());
  }
  EXPECT_GT(grown, 0);
}

TEST(CoplanarityDiagnosis, CollinearIsWhatTheCamerasOfEveryPointAre) {
  // Two strips of real flights, a metre beside their lines.
  std::vector<Eigen::Vector3d> centres;
  for (int strip = 0; strip < 2; ++strip)
    for (int i = 0; i < 4; ++i) centres.emplace_back(20.0 * i - 30, 60.0 * strip - 30 + (i % 2), -60);
  CoplanarityNetwork strips = looking_up(centres);
  for (int i = 0; i < 6; ++i) {
    see(strips, ground_point(i), {0, 1, 2, 3});
    see(strips, ground_point(i), {4, 5, 6, 7});
    see(strips, ground_point(i), {0, 4});  // two: nothing to tell
  }
  EXPECT_TRUE(diagnose(strips).collinear);
  see(strips, ground_point(6), {0, 1, 5});
  EXPECT_FALSE(diagnose(strips).collinear);

  EXPECT_FALSE(diagnose(four_cameras()).collinear);
  CoplanarityNetwork two = looking_up({centres[0], centres[1]});
  for (int i = 0; i < 6; ++i) see(two, ground_point(i), {0, 1});
  EXPECT_FALSE(diagnose(two).collinear);
  EXPECT_THAT(adjust_by_coplanarity(two, {}).remarks(), testing::Not(testing::Contains(testing::HasSubstr("line"))));
}

}  // namespace
}  // namespace megablock
