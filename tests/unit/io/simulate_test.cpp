#include "io/simulate/simulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/rotation.h"
#include "io/error.h"

namespace megablock {
namespace {

SimulationOptions aerial_options() {
  SimulationOptions options;
  options.frames = 120;
  options.points_per_frame = 200;
  return options;
}

SimulationOptions street_options() {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 300;
  options.points_per_frame = 200;
  options.image_height = 1080;
  options.relative_position_sigma_m = 0.01;
  return options;
}

class SimulateTest : public testing::TestWithParam<SimulationOptions> {};

Eigen::Vector3d in_camera(const SimulatedBlock& s, ImageIndex image, const Eigen::Vector3d& point) {
  const Image& entry = s.block.images[image];
  const Pose& mount = s.truth.mounts[s.block.frames[entry.frame].rig][static_cast<std::size_t>(entry.mount)];
  return to_camera(s.truth.frames[entry.frame], mount, point);
}

// Residuals of the truth have the stated noise: their normalised square sum is chi-square distributed.
TEST_P(SimulateTest, TruthLeavesTheStatedNoise) {
  const SimulatedBlock s = simulate_block(GetParam());
  double chi2 = 0, n = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t)
    for (auto o = static_cast<std::size_t>(s.tracks.begin[t]); o < static_cast<std::size_t>(s.tracks.begin[t + 1]);
         ++o) {
      const ImageIndex image = s.tracks.image[o];
      const Camera& camera = s.block.cameras[s.block.camera_of(image)];
      const Eigen::Vector2d measured(from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o]));
      ASSERT_TRUE(measured.x() >= 0 && measured.x() <= camera.width && measured.y() >= 0 &&
                  measured.y() <= camera.height);
      const Eigen::Vector3d inside = in_camera(s, image, s.points[t]);
      ASSERT_GT(inside.z(), 0);
      const Eigen::Vector2d residual = project(s.truth.cameras[s.block.camera_of(image)], inside) - measured;
      chi2 += (residual / GetParam().image_noise_px).squaredNorm();
      n += 2;
    }
  EXPECT_NEAR(chi2 / n, 1, 5 * std::sqrt(2 / n));
}

TEST_P(SimulateTest, TracksAreWellFormed) {
  const SimulatedBlock s = simulate_block(GetParam());
  ASSERT_EQ(s.tracks.track_count(), std::ssize(s.points));
  ASSERT_EQ(s.tracks.begin.size(), s.points.size() + 1);
  ASSERT_EQ(s.outlier.size(), s.tracks.image.size());
  for (std::size_t t = 0; t < s.points.size(); ++t) {
    ASSERT_EQ(s.tracks.id[t].value, static_cast<std::int64_t>(t));
    const auto begin = s.tracks.image.begin() + s.tracks.begin[t], end = s.tracks.image.begin() + s.tracks.begin[t + 1];
    ASSERT_TRUE(std::is_sorted(begin, end));
    ASSERT_EQ(std::adjacent_find(begin, end), end);
    ASSERT_NE(s.block.images[*begin].frame, s.block.images[*(end - 1)].frame);  // seen from two places
  }
}

TEST_P(SimulateTest, CountsAreAsAsked) {
  const SimulatedBlock s = simulate_block(GetParam());
  ASSERT_EQ(std::ssize(s.block.frames), GetParam().frames);
  std::vector<std::int64_t> count(s.block.frames.size(), 0);
  for (const ImageIndex image : s.tracks.image) ++count[static_cast<std::size_t>(s.block.images[image].frame.value)];
  const double observations = static_cast<double>(s.tracks.observation_count());
  EXPECT_NEAR(observations / static_cast<double>(s.tracks.track_count()), GetParam().mean_track,
              0.08 * GetParam().mean_track);
  EXPECT_NEAR(observations / static_cast<double>(GetParam().frames), GetParam().points_per_frame,
              0.12 * GetParam().points_per_frame);
  EXPECT_GE(*std::min_element(count.begin(), count.end()), 0.9 * GetParam().points_per_frame);
  EXPECT_LE(*std::max_element(count.begin(), count.end()), 1.8 * GetParam().points_per_frame);
}

TEST_P(SimulateTest, SeedDecidesEverything) {
  SimulationOptions options = GetParam();
  options.frames = 40;
  const SimulatedBlock a = simulate_block(options), b = simulate_block(options);
  EXPECT_EQ(a.tracks.x, b.tracks.x);
  EXPECT_EQ(a.tracks.image, b.tracks.image);
  EXPECT_EQ(a.points, b.points);
  options.seed = 2;
  const SimulatedBlock c = simulate_block(options);
  EXPECT_NE(a.tracks.x, c.tracks.x);
  EXPECT_NE(a.truth.frames.front().centre, c.truth.frames.front().centre);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SimulateTest, testing::Values(aerial_options(), street_options()),
                         [](const auto& scene) { return scene.index == 0 ? "aerial" : "street"; });

}  // namespace
}  // namespace megablock
