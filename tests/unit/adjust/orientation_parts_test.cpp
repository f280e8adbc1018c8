// Components oriented in parts that are joined as independent models.
#include "adjust/orientation_parts.h"

#include <gtest/gtest.h>

#include <set>

#include "io/error.h"
#include "tests/unit/adjust/orientation_scene.h"

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
