// Layouts of control points and of flights, right and exchanged, with gross errors, over many seeds.
#include "adjust/orientation/mirrored_layout.h"

#include <gtest/gtest.h>

#include <random>

#include "geometry/similarity/similarity.h"

namespace megablock {
namespace {

// Points as the images see them, in a model of any place, direction and scale, and as a list gives them.
struct Layout {
  std::vector<Eigen::Vector3d> model, given;
  MeanAxes axes;
  std::mt19937_64 random;

  // `relief_m`: half of the range of heights; `bend_m`: of the model, at the corners.
  Layout(std::size_t points, double relief_m, double noise_m, double bend_m, std::uint64_t seed) : random(seed) {
    Similarity to_ground;
    to_ground.scale = std::exp(between(-3, 3));
    to_ground.rotation = rotation_exp<double>({between(-3, 3), between(-3, 3), between(-3, 3)});
    to_ground.translation = {between(-500, 500), between(-500, 500), between(-500, 500)};
    const Similarity to_model = to_ground.inverse();
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < points; ++i) {
      const Eigen::Vector3d place(between(-80, 80), between(-50, 50), between(-relief_m, relief_m));
      const Eigen::Vector3d bend(0, 0, bend_m * place.head<2>().squaredNorm() / (80 * 80 + 50 * 50));
      const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
      model.push_back(to_model(Eigen::Vector3d(place + bend + noise_m * noise)));
      given.push_back(place);
    }
    axes.view = to_model.rotation * Eigen::Vector3d(0.05, -0.03, -0.99);
    axes.down = to_model.rotation * Eigen::Vector3d(0.1, 0.1, 0.02);
  }
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  void exchange() {
    for (Eigen::Vector3d& p : given) std::swap(p.x(), p.y());
  }
  // Moves a point by 0.3 to 300 m.
  void spoil(std::size_t point) {
    const Eigen::Vector3d direction(between(-1, 1), between(-1, 1), between(-1, 1));
    given[point] += std::exp(between(-1.2, 5.7)) * direction.normalized();
  }
  // Looks to the horizon, with y down.
  void look_sideways() {
    const Eigen::Vector3d up = -axes.view.normalized();
    axes.view = axes.down.cross(up).normalized();
    axes.down = -up;
  }
  auto find(double sigma_m = 0.02) const { return find_mirrored_layout(model, given, sigma_m, axes); }
};

TEST(MirroredLayout, IsFoundInAnExchangedListWithAGrossError) {
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Layout layout(6, 12, 0.03, 0.05, seed);
    layout.exchange();
    layout.spoil(seed % 6);
    const auto found = layout.find();
    seen += found.has_value();
    if (!found) continue;
    EXPECT_EQ(found->reflection, Reflection::kExchanged);
    EXPECT_LT(found->mirrored_m, 0.3) << seed;
  }
  // The five best points of six may lie in a plane by chance.
  EXPECT_GE(seen, 298);
}

// A sign that is wrong is the same mirror image, turned.
TEST(MirroredLayout, IsFoundWithAWrongSign) {
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Layout layout(7, 12, 0.03, 0.05, seed);
    for (Eigen::Vector3d& p : layout.given) p[static_cast<int>(seed % 2)] *= -1;
    seen += layout.find().has_value();
  }
  EXPECT_GE(seen, 98);
}

// A nearly level flight: the positions turn the block over, and fit to half a metre.
TEST(MirroredLayout, IsFoundInPositionsOfALevelFlight) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Layout layout(30, 1.5, 0.05, 0.1, seed);
    layout.exchange();
    const auto found = layout.find(0.05);
    ASSERT_TRUE(found) << seed;
    EXPECT_LT(found->given_m, 2) << seed;
  }
}

TEST(MirroredLayout, IsFoundByImagesThatLookSideways) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Layout layout(8, 20, 0.03, 0.05, seed);
    layout.look_sideways();
    layout.exchange();
    EXPECT_TRUE(layout.find()) << seed;
  }
}

// No false alarm, however many gross errors: none, some, or nearly all points.
TEST(MirroredLayout, IsNotSeenInRightCoordinates) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    const std::size_t points = 4 + seed % 9;
    Layout layout(points, seed % 3 == 0 ? 0.1 : 15, 0.05, seed % 5 == 0 ? 1.0 : 0.1, seed);
    for (std::size_t wrong = 0; wrong < seed % (points - 1); ++wrong) layout.spoil(wrong);
    if (seed % 4 == 0) layout.look_sideways();
    alarms += layout.find().has_value();
  }
  EXPECT_EQ(alarms, 0);
}

// Nothing in a plane tells the two apart: such a block is right or upside down.
TEST(MirroredLayout, IsNotSeenInAPlaneOrOnALine) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Layout plane(8, 0, 0.03, 0, seed), line(8, 10, 0.03, 0, seed);
    plane.exchange();
    EXPECT_FALSE(plane.find()) << seed;
    for (std::size_t i = 0; i < 8; ++i) line.model[i] = line.model[0] + i * (line.model[1] - line.model[0]);
    for (std::size_t i = 0; i < 8; ++i) line.given[i] = line.given[0] + i * (line.given[1] - line.given[0]);
    line.exchange();
    EXPECT_FALSE(line.find()) << seed;
  }
}

TEST(MirroredLayout, NeedsFourPoints) {
  Layout layout(3, 20, 0.01, 0, 1);
  layout.exchange();
  EXPECT_FALSE(layout.find());
  EXPECT_FALSE(find_mirrored_layout({}, {}, 0.02, layout.axes));
}

// The points of a block that has its place from positions of 3 m, in the axes of the ground, against control.
struct PlacedLayout : Layout {
  explicit PlacedLayout(std::size_t points, std::uint64_t seed) : Layout(points, seed % 2 ? 0 : 15, 0, 0, seed) {
    const Eigen::Vector3d shift(between(-5, 5), between(-5, 5), between(-50, 50));
    const Eigen::Quaterniond turn = rotation_exp<double>({between(-0.03, 0.03), between(-0.03, 0.03), 0.02});
    const double scale = between(0.98, 1.02);
    model.clear();
    for (const Eigen::Vector3d& place : given) model.push_back(scale * (turn * place) + shift);
  }
  auto find() const { return find_mirrored_layout_in_place(model, given); }
};

TEST(MirroredLayout, InPlaceTellsTheReflections) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    PlacedLayout exchanged(7, seed), first(7, seed), second(7, seed);
    exchanged.exchange();
    exchanged.spoil(seed % 7);
    for (Eigen::Vector3d& p : first.given) p.x() *= -1;
    for (Eigen::Vector3d& p : second.given) p.y() *= -1;
    ASSERT_TRUE(exchanged.find()) << seed;
    EXPECT_EQ(exchanged.find()->reflection, Reflection::kExchanged) << seed;
    ASSERT_TRUE(first.find()) << seed;
    EXPECT_EQ(first.find()->reflection, Reflection::kFirstReversed) << seed;
    ASSERT_TRUE(second.find()) << seed;
    EXPECT_EQ(second.find()->reflection, Reflection::kSecondReversed) << seed;
  }
}

TEST(MirroredLayout, InPlaceIsNotSeenInRightCoordinates) {
  int alarms = 0;
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    const std::size_t points = 3 + seed % 9;
    PlacedLayout layout(points, seed);
    for (std::size_t wrong = 0; wrong < seed % (points - 1); ++wrong) layout.spoil(wrong);
    alarms += layout.find().has_value();
  }
  EXPECT_EQ(alarms, 0);
}

}  // namespace
}  // namespace megablock
