// Components oriented in parts that are joined as independent models.
#include "adjust/orientation/orientation_parts.h"

#include <gtest/gtest.h>

#include <set>

#include "adjust/orientation/steps/orientation_options.h"
#include "io/base/error.h"
#include "tests/support/adjust/orientation_scene.h"
#include "tests/support/adjust/seen_verticals.h"

namespace megablock {
namespace {

using namespace orientation_scene;

// Nadir images 80 m above the ground in rows of 20.
SimulatedBlock rows_of_images(int rows) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Pose> poses;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < 20; ++c) {
      const Eigen::Quaterniond tilt = rotation_exp<double>(2 * kDegree * normal_vector(random));
      poses.push_back({(tilt * looking({0, 0, -1}, {0, r % 2 ? -1.0 : 1.0, 0})).normalized(),
                       Eigen::Vector3d(14 * c, 30 * r, 80) + 0.5 * normal_vector(random)});
    }
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 60 * 20 * rows; ++p)
    points.emplace_back(-50 + 380 * uniform(random), -50 + (30 * rows + 100) * uniform(random), 10 * uniform(random));
  return make_scene(poses, points, {});
}

TEST(OrientationParts, OverlapAndCoverAll) {
  const SimulatedBlock scene = rows_of_images(8);
  const auto parts = orientation_parts(scene.block, all_frames(scene.block), pairs_of(scene), 50);
  EXPECT_EQ(parts.size(), 4u);
  std::set<FrameIndex> cores;
  for (const OrientationPart& part : parts) {
    EXPECT_LE(part.core, 50u);
    EXPECT_GT(part.frames.size(), part.core);
    for (std::size_t i = 0; i < part.core; ++i) EXPECT_TRUE(cores.insert(part.frames[i]).second);
  }
  EXPECT_EQ(cores.size(), 160u);
}

TEST(OrientationParts, PartsMakeTheBlock) {
  const SimulatedBlock scene = rows_of_images(5);
  const auto pairs = pairs_of(scene);
  OrientationOptions options;
  options.part_frames = 50;
  const auto result =
      orient_component(scene.block, initial_state(scene.block), all_frames(scene.block), pairs, scene.tracks, options);
  const Errors whole = errors_of(scene, orient(scene, pairs), true), parts = errors_of(scene, result, true);
  std::printf("[ reached  ] whole %.3f m %.4f deg; %s: %.3f m %.4f deg\n", whole.position_m, whole.rotation_deg,
              result.summary.c_str(), parts.position_m, parts.rotation_deg);
  EXPECT_EQ(parts.oriented, whole.oriented);
  EXPECT_LT(parts.position_m, 0.5);
  EXPECT_LT(parts.rotation_deg, 0.2);
}

// Images over a slope: the plane of the first part is not level, and only verticals far from it tell.
TEST(OrientationParts, LevelOfThePartsThatKnowIt) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  constexpr double kSlope = 0.15;
  std::vector<Pose> poses;
  for (int r = 0; r < 8; ++r)
    for (int c = 0; c < 20; ++c)
      poses.push_back({looking({0, 0, -1}, {0, r % 2 ? -1.0 : 1.0, 0}).normalized(),
                       Eigen::Vector3d(14 * c, 30 * r, 80 + kSlope * 14 * c) + 0.5 * normal_vector(random)});
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 60 * 20 * 8; ++p) {
    const double x = -50 + 380 * uniform(random);
    points.emplace_back(x, -50 + 340 * uniform(random), kSlope * x + 10 * uniform(random));
  }
  SimulatedBlock scene = make_scene(poses, points, {});
  add_seen_verticals(scene, {.sigma_deg = 0.1, .noise_deg = 0.1});
  const auto parts = orientation_parts(scene.block, all_frames(scene.block), pairs_of(scene), 50);
  const std::set<FrameIndex> first(parts.front().frames.begin(), parts.front().frames.end());
  std::erase_if(scene.block.verticals,
                [&](const SeenVertical& seen) { return first.contains(scene.block.images[seen.image].frame); });
  OrientationOptions options;
  options.part_frames = 50;
  const auto result = orient_component(scene.block, initial_state(scene.block), all_frames(scene.block),
                                       pairs_of(scene), scene.tracks, options);
  EXPECT_NE(result.summary.find("4 parts"), std::string::npos) << result.summary;
  const double off = off_level_deg(scene, result);
  std::printf("[ reached  ] %s: %.3f deg off level\n", result.summary.c_str(), off);
  EXPECT_LT(off, 0.3);
}

// Parts of a chain share two frames, too few for a similarity that can be trusted.
TEST(OrientationParts, AsAWholeWherePartsDoNotFitTogether) {
  const SimulatedBlock scene = rows_of_images(6);
  auto pairs = pairs_of(scene);
  std::erase_if(pairs, [](const VerifiedPair& pair) { return std::abs(pair.a.value - pair.b.value) != 1; });
  OrientationOptions options;
  options.part_frames = 60;
  const auto result =
      orient_component(scene.block, initial_state(scene.block), all_frames(scene.block), pairs, scene.tracks, options);
  EXPECT_NE(result.summary.find("as a whole"), std::string::npos) << result.summary;
  EXPECT_GT(errors_of(scene, result, true).oriented, 100u) << result.summary;
}

TEST(OrientationParts, WithPositionsAsAWhole) {
  SimulatedBlock scene = rows_of_images(3);
  const auto pairs = pairs_of(scene);
  scene.block.frames[FrameIndex(0)].position_prior = PositionPrior{{0, 0, 80}, {1, 1, 1}, {0, 0, 0}};
  OrientationOptions options;
  options.part_frames = 50;
  const auto result =
      orient_component(scene.block, initial_state(scene.block), all_frames(scene.block), pairs, scene.tracks, options);
  EXPECT_EQ(result.summary.find("parts"), std::string::npos) << result.summary;
  options.part_frames = 20;
  EXPECT_THROW(options.check(), InputError);
}

}  // namespace
}  // namespace megablock
