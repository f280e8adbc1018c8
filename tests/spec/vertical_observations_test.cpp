// Acceptance test AT-34: observed verticals in the adjustment (M58). A strip of 200 nadir images, positions at its two
// ends alone, adjusted with a camera whose radial distortion is wrong: between the ends the strip rises like a dome.
#include <cmath>

#include "adjust/terms/vertical_terms.h"
#include "geometry/numbers/median.h"
#include "reached.h"
#include "tests/support/adjust/orientation_scene.h"
#include "tests/support/adjust/seen_verticals.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

using namespace orientation_scene;

constexpr int kImages = 200;
constexpr double kBase = 20, kHeight = 100;  // metres; images are 125 m x 83 m on the ground
constexpr double kWrongRadial = 0.0003;      // 0.15 px at the edges of the image

SimulatedBlock strip() {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Pose> poses;
  for (int i = 0; i < kImages; ++i) {
    const Eigen::Quaterniond tilt = rotation_exp<double>(2 * kDegree * normal_vector(random));
    poses.push_back({(tilt * looking({0, 0, -1}, {0, -1, 0})).normalized(),
                     Eigen::Vector3d(kBase * i, 0, kHeight) + 0.5 * normal_vector(random)});
  }
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < 25 * kImages; ++p)
    points.push_back({kBase * kImages * uniform(random), 80 * (uniform(random) - 0.5), 10 * (uniform(random) - 0.5)});
  SceneOptions options;
  options.wrong_tracks = 0;
  options.gps_sigma_m = 0.05;
  SimulatedBlock scene = make_scene(poses, points, options);
  for (int i = 3; i < kImages - 3; ++i) scene.block.frames[FrameIndex(i)].position_prior.reset();
  scene.truth.oriented.assign(kImages, 1);
  return scene;
}

struct Adjusted {
  double dome = 0;          // the middle's height above the truth, metres
  double rms = 0;           // of all heights
  int iterations = 0;       // of the whole block to its optimum, from the same start
  int wrong_verticals = 0;  // those that are 20 degrees off
  double wrong_weight = 0;  // of the loss, the largest of theirs
};

Adjusted adjusted(SimulatedBlock scene, double wrong_radial) {
  constexpr double kStartNoise = 0.5;  // metres and milliradians
  scene.block.cameras[CameraIndex(0)].intrinsics[kRadial1] += wrong_radial;
  const TiledBlock block(scene, 60, {}, kStartNoise);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalOptions options;
  GlobalState global = start_global(options);
  adjust_globally(runner, options, global);
  EXPECT_EQ(global.outcome, GlobalOutcome::kConverged) << describe(global);
  const TileState state = block.gathered(runner.problems(), runner.states());

  Adjusted result;
  result.iterations = global.iterations;
  std::vector<double> middle;
  for (int i = 0; i < kImages; ++i) {
    const double error =
        state.frames[static_cast<std::size_t>(i)].centre.z() - scene.truth.frames[FrameIndex(i)].centre.z();
    result.rms += error * error / kImages;
    if (std::abs(i - kImages / 2) < 10) middle.push_back(error);
  }
  result.rms = std::sqrt(result.rms);
  result.dome = std::abs(median(middle));
  for (const auto& term : block.whole.verticals) {
    const TileImage& image = block.whole.images[static_cast<std::size_t>(term.image.value)];
    const Eigen::Vector3d truth =
        scene.truth.frames[block.whole.frames[static_cast<std::size_t>(image.frame.value)]].rotation *
        -Eigen::Vector3d::UnitZ();
    if ((term.seen - truth).norm() < 10 * kDegree) continue;
    ++result.wrong_verticals;
    const double squares = linearise_vertical(block.whole, state, term).residual.squaredNorm();
    keep_largest(result.wrong_weight, block.whole.vertical_loss.evaluate(squares)[1]);
  }
  return result;
}

SimulatedBlock with_verticals(const SimulatedBlock& scene, double sigma_deg, double wrong_share) {
  SimulatedBlock result = scene;
  add_seen_verticals(result, {.sigma_deg = sigma_deg, .noise_deg = sigma_deg, .wrong_share = wrong_share});
  return result;
}

void print(const char* what, const Adjusted& a) {
  std::printf("[ strip    ] %s: dome %.3f m, heights %.3f m rms, %d iterations\n", what, a.dome, a.rms, a.iterations);
}

TEST(Spec, AT34VerticalsFlattenADome) {
  const SimulatedBlock scene = strip();
  const Adjusted calibrated = adjusted(scene, 0), without = adjusted(scene, kWrongRadial);
  print("calibrated, no verticals", calibrated);
  print("wrong distortion, no verticals", without);
  const Adjusted imu = adjusted(with_verticals(scene, 0.5, 0), kWrongRadial);
  print("0.5 degrees", imu);
  const Adjusted seen = adjusted(with_verticals(scene, 0.01, 0), kWrongRadial);
  print("0.01 degrees", seen);
  const Adjusted wrong = adjusted(with_verticals(scene, 0.01, 0.1), kWrongRadial);
  print("0.01 degrees, one in ten 20 degrees off", wrong);
  EXPECT_GT(without.dome, 1) << "the strip must dome without them";
  expect_at_most(seen.dome / without.dome, 0.03, "dome with verticals of 0.01 deg over that without");
  expect_at_most(imu.iterations, without.iterations, "iterations with verticals of 0.5 deg");
  expect_at_most(seen.iterations, without.iterations, "iterations with verticals of 0.01 deg");
  expect_at_most(wrong.dome / without.dome, 0.05, "dome with one vertical in ten 20 degrees off");
  expect_at_most(wrong.iterations, without.iterations, "iterations with one vertical in ten 20 degrees off");
  expect_at_least(wrong.wrong_verticals, 10, "wrong verticals of 200");
  expect_at_most(wrong.wrong_weight, 0.01, "largest weight of a wrong vertical");
}

}  // namespace
}  // namespace megablock
