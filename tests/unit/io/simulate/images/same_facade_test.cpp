#include "io/simulate/images/same_facade.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/camera/camera.h"
#include "io/simulate/images/city.h"
#include "io/simulate/scene/four_sides.h"

namespace megablock {
namespace {

constexpr double kFootprint = 0.02;  // metres

// The mean difference of the green of two sides, over the walls of a storey and a half.
double difference(double own, int a, int b) {
  const Texture texture(1, 0.05);
  double sum = 0, n = 0;
  for (double along = -10; along < 10; along += 0.21)
    for (double up = 0.1; up < 9; up += 0.23, ++n)
      sum += std::abs(static_cast<double>(same_facade_colour(texture, {along, up, a, kFootprint}, own)[1] -
                                          same_facade_colour(texture, {along, up, b, kFootprint}, own)[1]));
  return sum / n;
}

TEST(SameFacade, SidesAreAlikeUpToTheirOwnDetail) {
  EXPECT_EQ(difference(0, 0, 2), 0);
  EXPECT_GT(difference(0.2, 0, 2), 1);
  EXPECT_GT(difference(1, 0, 2), 2 * difference(0.2, 0, 2));
  EXPECT_EQ(difference(1, 3, 3), 0);
}

// A quarter of a turn takes each side to the next one, and a spot to the same spot of its facade. Nothing is mirrored.
TEST(SameFacade, AQuarterOfATurnTakesASideToTheNext) {
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(std::acos(0.0), Eigen::Vector3d::UnitZ()));
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX(), point(7, 2, 3);
  EXPECT_NEAR(along_facade(normal, point), 2, 1e-12);  // one who looks west has the north at the right
  for (int side = 0; side < 4; ++side) {
    EXPECT_EQ(facade_side(normal), side);
    EXPECT_NEAR(along_facade(normal, point), 2, 1e-12);
    normal = quarter * normal;
    point = quarter * point;
  }
}

class FourSides : public testing::TestWithParam<SimulationOptions::Scene> {
 protected:
  FourSides() : options_(SimulationOptions::of(GetParam())) {
    options_.own_detail = 0;
    layout_ =
        GetParam() == SimulationOptions::Scene::kTower ? make_tower_layout(options_) : make_courtyard_layout(options_);
    city_ = std::make_unique<City>(options_, layout_);
  }
  SimulationOptions options_;
  Layout layout_;
  std::unique_ptr<City> city_;
};

// Without detail of its own every side has the same colours, apart from light, shadow and ground.
TEST_P(FourSides, ACameraSeesTheSameAfterAQuarterOfATurn) {
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(std::acos(0.0), Eigen::Vector3d::UnitZ()));
  Random random(1, Random::Purpose::kNoise);
  int walls = 0;
  for (const Pose& frame : layout_.truth.frames)
    for (int i = 0; i < 20; ++i) {
      const double right = random.uniform(-0.5, 0.5), down = random.uniform(-0.4, 0.4);
      const Eigen::Vector3d direction = (frame.rotation.conjugate() * Eigen::Vector3d(right, down, 1)).normalized();
      const City::Hit one = city_->cast(frame.centre, direction);
      const City::Hit other = city_->cast(quarter * frame.centre, quarter * direction);
      ASSERT_EQ(one.object < 0, other.object < 0);
      if (one.object < 0 || std::abs(one.normal.z()) > 0.5) continue;
      ++walls;
      ASSERT_NEAR(one.distance, other.distance, 1e-9);
      const Eigen::Vector3f a = city_->colour(one, direction, 0.002) / city_->light(one.point, one.normal);
      const Eigen::Vector3f b =
          city_->colour(other, quarter * direction, 0.002) / city_->light(other.point, other.normal);
      EXPECT_LT((a - b).norm(), 0.5f);
    }
  EXPECT_GT(walls, 100);
}

TEST_P(FourSides, CamerasStandOnARingAndSeeFacades) {
  ASSERT_EQ(std::ssize(layout_.truth.frames), options_.frames);
  for (const Pose& frame : layout_.truth.frames) {
    EXPECT_NEAR(frame.centre.z(), 1.6, 0.21);
    const Eigen::Vector3d ahead = frame.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    EXPECT_LT(ahead.dot(frame.centre), 0);  // towards the middle
    const City::Hit hit = city_->cast(frame.centre, ahead);
    ASSERT_GE(hit.object, 0);
    EXPECT_LT(hit.distance, 30);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, FourSides,
                         testing::Values(SimulationOptions::Scene::kCourtyard, SimulationOptions::Scene::kTower),
                         [](const auto& scene) { return scene.index == 0 ? "courtyard" : "tower"; });

}  // namespace
}  // namespace megablock
