// Which parameters blocks of several kinds determine, against their true cameras.
#include "merge/camera/determined_parameters.h"

#include <gmock/gmock.h>

#include <random>

#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

using testing::HasSubstr;

CameraChoice choice_of(const SimulatedBlock& simulated) {
  BlockState start = simulated.truth;
  start.cameras = initial_state(simulated.block).cameras;
  return determined_parameters(simulated.block, start, simulated.tracks, {CameraIndex(0)},
                               IndexedVector<CameraIndex, double>(1, 0.0), {}, {})
      .front();
}

SimulationOptions aerial(std::int64_t frames) {
  SimulationOptions options;
  options.frames = frames;
  options.points_per_frame = 200;
  options.image_noise_px = 0.3;
  options.terrain_relief_m = 30;
  return options;
}

constexpr ParameterMask kAlwaysEstimated = mask_of(kFocal) | mask_of(kPrincipalX) | mask_of(kPrincipalY);

// Of a lens without distortion nothing but f, cx and cy is estimated.
TEST(DeterminedParameters, OfALensWithoutDistortion) {
  SimulationOptions options = aerial(30);
  options.distortion = false;
  const CameraChoice choice = choice_of(simulate_block(options));
  EXPECT_EQ(choice.estimated & ~kAlwaysEstimated, ParameterMask{0}) << choice.reason;
  EXPECT_TRUE(contains(choice.estimated, kFocal)) << choice.reason;
}

TEST(DeterminedParameters, OfALensWithDistortion) {
  const CameraChoice choice = choice_of(simulate_block(aerial(30)));
  for (const int p : {kFocal, kRadial1}) EXPECT_TRUE(contains(choice.estimated, p)) << choice.reason;
  for (const int p : {kAffinity, kSkew}) EXPECT_FALSE(contains(choice.estimated, p)) << choice.reason;
}

TEST(DeterminedParameters, OfPixelsThatAreNotSquare) {
  SimulationOptions options = aerial(30);
  options.affinity = 0.01;
  const SimulatedBlock simulated = simulate_block(options);
  const Intrinsics& truth = simulated.truth.cameras[CameraIndex(0)];
  ASSERT_GT(std::abs(truth[kAffinity]) + std::abs(truth[kSkew]), 4);
  const CameraChoice choice = choice_of(simulated);
  for (const int p : {kAffinity, kSkew})
    if (std::abs(truth[p]) > 3) {
      EXPECT_TRUE(contains(choice.estimated, p)) << choice.reason;
    }
}

// Positions and relief determine the focal length of the block; its prior allows 5 %.
TEST(DeterminedParameters, SayWhereAKnownFocalLengthIsContradicted) {
  for (const double start : {1.0, 0.7, 1.3}) {
    SimulatedBlock simulated = simulate_block(aerial(30));
    Camera& camera = simulated.block.cameras[CameraIndex(0)];
    camera.intrinsics[kFocal] = start * simulated.truth.cameras[CameraIndex(0)][kFocal];
    camera.focal_known = true;
    EXPECT_EQ(choice_of(simulated).focal_contradicted, start != 1) << start;
    camera.focal_known = false;
    EXPECT_FALSE(choice_of(simulated).focal_contradicted) << "of a guess: " << start;
  }
}

TEST(DeterminedParameters, GiveTheFocalLengthWithItsSigma) {
  double squares = 0;
  constexpr int kSeeds = 20;
  for (int seed = 0; seed < kSeeds; ++seed) {
    SimulationOptions options = aerial(12);
    options.seed = static_cast<std::uint64_t>(seed);
    options.image_noise_px = AdjustOptions().observations.image_sigma_px;
    SimulatedBlock simulated = simulate_block(options);
    const double truth = simulated.truth.cameras[CameraIndex(0)][kFocal];
    Camera& camera = simulated.block.cameras[CameraIndex(0)];
    camera.intrinsics[kFocal] = 0.8 * truth;
    camera.focal_known = false;
    const CameraChoice choice = choice_of(simulated);
    ASSERT_GT(choice.focal_sigma_px, 0) << seed;
    EXPECT_NEAR(choice.focal_px, truth, 0.02 * truth) << seed;
    squares += std::pow((choice.focal_px - truth) / choice.focal_sigma_px, 2);
  }
  // Screening, the choice of parameters and the prior move the ratio a little.
  EXPECT_GT(squares / kSeeds, 0.3);
  EXPECT_LT(squares / kSeeds, 2.5);
}

// Each image has an error of its own that looks like an affinity and a decentring. The normal equations see many
// sigmas.
TEST(DeterminedParameters, AreNotThoseOfErrorsOfSingleImages) {
  SimulationOptions options = aerial(30);
  options.distortion = false;
  SimulatedBlock simulated = simulate_block(options);
  simulated.block.cameras[CameraIndex(0)].prior_sigma[kAffinity] = 15;  // asked for
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<Intrinsics> own;
  for (std::size_t i = 0; i < simulated.block.images.size(); ++i) {
    Intrinsics k = simulated.truth.cameras[CameraIndex(0)];
    k[kDecentring1] = 3e-4 * normal(random);
    k[kDecentring2] = 3e-4 * normal(random);
    k[kAffinity] = 1.5 * normal(random);
    own.push_back(k);
  }
  TrackSet& tracks = simulated.tracks;
  for (std::int64_t o = 0; o < tracks.observation_count(); ++o) {
    const auto row = static_cast<std::size_t>(o);
    const Eigen::Vector2d pixel(from_fixed_pixel(tracks.x[row]), from_fixed_pixel(tracks.y[row]));
    const auto ray = viewing_ray(simulated.truth.cameras[CameraIndex(0)], pixel);
    ASSERT_TRUE(ray);
    const Eigen::Vector2d moved = project(own[static_cast<std::size_t>(tracks.image[row].value)], *ray);
    tracks.x[row] = to_fixed_pixel(moved.x());
    tracks.y[row] = to_fixed_pixel(moved.y());
  }
  const CameraChoice choice = choice_of(simulated);
  for (const int p : {kDecentring1, kDecentring2, kAffinity})
    EXPECT_FALSE(contains(choice.estimated, p)) << choice.reason;
}

// Two images of a lens without distortion show neither f, nor where the centre is, nor any distortion.
TEST(DeterminedParameters, OfTwoImagesAreOnlyWhatTheyShow) {
  SimulationOptions options = aerial(2);
  options.gps_sigma_m = 0;
  options.distortion = false;
  SimulatedBlock simulated = simulate_block(options);
  simulated.block.cameras[CameraIndex(0)].intrinsics = simulated.truth.cameras[CameraIndex(0)];
  const CameraChoice choice = choice_of(simulated);
  EXPECT_EQ(choice.estimated, ParameterMask{0}) << choice.reason;
  EXPECT_THAT(choice.reason, HasSubstr("left-out tie points"));
}

// Flat ground from above without positions: height and focal length are nearly one, and the prior says how good the
// start is.
TEST(DeterminedParameters, OfAFlatFreeBlockHaveTheFocalLength) {
  SimulationOptions options = aerial(30);
  options.gps_sigma_m = 0;
  options.terrain_relief_m = 0;
  const CameraChoice choice = choice_of(simulate_block(options));
  EXPECT_TRUE(contains(choice.estimated, kFocal)) << choice.reason;
}

TEST(DeterminedParameters, AreTheSameOnAnyNumberOfThreads) {
  const SimulatedBlock simulated = simulate_block(aerial(20));
  const CameraChoice first = choice_of(simulated), second = choice_of(simulated);
  EXPECT_EQ(first.estimated, second.estimated);
  EXPECT_EQ(first.reason, second.reason);
}

}  // namespace
}  // namespace megablock
