// Against the cameras of the published simulations (Cannelle 2013, 2.3.3): start with the focal length at 80 %, centres
// in the middle of the image, no distortion. The whole table: tests/benchmark/compare_panoramic.cpp.
#include "adjust/calibration/panoramic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "adjust/calibration/panoramic_system.h"
#include "io/base/error.h"
#include "tests/support/adjust/panorama.h"

namespace megablock {
namespace {

using testing::HasSubstr;

struct Trial {
  const PublishedCamera& camera;
  PanoramicResult result;
  PanoramicError error;
};

// 24 images and a sphere subdivided three times, for speed; the long lenses see enough points of the fourth only.
Trial run(int number, PanoramaSimulation simulation, const PanoramicOptions& options = {}) {
  const PublishedCamera& c = published_cameras()[static_cast<std::size_t>(number)];
  const bool wide = number == 0 || number == 2;
  simulation.images = wide ? 24 : 30;
  simulation.subdivisions = wide ? 3 : 4;
  const SimulatedPanorama panorama = simulate_panorama(c.truth, c.width, c.height, simulation);
  PanoramicResult result =
      calibrate_panoramic(panorama.tracks, published_start(c.truth, c.width, c.height), c.width, c.height, options);
  const PanoramicError error = error_of(result.camera, c.truth, c.width, c.height);
  return {c, std::move(result), error};
}

class PublishedPanorama : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Cameras, PublishedPanorama, testing::Range(0, 4));

TEST_P(PublishedPanorama, FindsTheCameraOfExactMeasurements) {
  const Trial t = run(GetParam(), {.noise_px = 0});
  // Weak priors are felt where the lens has hardly any distortion, by a hundredth of what half a pixel of noise does.
  EXPECT_LT(t.error.focal_px, 0.05);
  EXPECT_LT(t.error.principal_px, 0.1);
  EXPECT_LT(t.error.edge_px, 0.1);
  EXPECT_LT(t.result.rms_px, 2e-3);
  EXPECT_EQ(t.result.rejected, 0);
}

// Published: nearly perfect up to 0.5 px. Errors are those of the posterior sigmas: chi-square of 8 parameters.
TEST_P(PublishedPanorama, HalfAPixelOfNoiseGivesErrorsWithinTheSigmas) {
  const Trial t = run(GetParam(), {.noise_px = 0.5, .seed = 3});
  EXPECT_NEAR(t.result.sigma_px, 0.5, 3 * 0.5 / std::sqrt(2.0 * static_cast<double>(t.result.degrees_of_freedom)));
  EXPECT_GT(t.result.chi2_probability, 1e-3);
  Eigen::VectorXd error(t.result.camera.size());
  for (int p = 0; p < t.result.camera.size(); ++p)
    error[p] = (t.result.camera[p] - t.camera.truth[p]) / t.result.sigma(p);
  Eigen::MatrixXd correlation = t.result.covariance;
  for (int p = 0; p < error.size(); ++p)
    for (int q = 0; q < error.size(); ++q) correlation(p, q) /= t.result.sigma(p) * t.result.sigma(q);
  EXPECT_LT(error.dot(correlation.fullPivLu().solve(error)), 29.6);  // 1 in 4000
  EXPECT_LT(t.error.edge_px, 2);
  EXPECT_LT(t.error.focal_px, 3e-3 * t.camera.truth[kFocal]);
  EXPECT_TRUE(t.result.warnings.empty()) << t.result.warnings.front();
}

TEST(Panoramic, ErrorsGrowLinearlyWithNoise) {
  const Trial one = run(2, {.noise_px = 0.1}), four = run(2, {.noise_px = 0.4});
  EXPECT_NEAR(four.result.sigma(kFocal) / one.result.sigma(kFocal), 4, 0.2);
  EXPECT_NEAR(four.error.principal_px / one.error.principal_px, 4, 0.4);
  EXPECT_NEAR(four.error.symmetry_px / one.error.symmetry_px, 4, 0.4);
}

// Published: about two pixels on focal length, principal point or distortion for 1 cm at 10 m.
TEST(Panoramic, OneCentimetreBesideTheAxisCostsAPixelOrTwo) {
  const Trial along = run(2, {.noise_px = 0, .off_centre = {0, 0, 0.01}});
  EXPECT_GT(along.error.focal_px, 0.5);
  EXPECT_LT(along.error.focal_px, 3);
  const Trial across = run(2, {.noise_px = 0, .off_centre = {0.01, 0, 0}});
  EXPECT_LT(across.error.focal_px, along.error.focal_px);
  EXPECT_LT(across.error.principal_px, 3);
}

TEST(Panoramic, ACentreBesideTheAxisShowsAtUnequalDistances) {
  const Trial same = run(2, {.depth_spread = 0.5, .noise_px = 0.5});
  EXPECT_TRUE(same.result.warnings.empty());
  EXPECT_LT(same.result.parallax.deviations, 5);
  const Trial beside = run(2, {.depth_spread = 0.5, .noise_px = 0.5, .off_centre = {0.01, 0, 0.03}});
  EXPECT_GT(beside.result.parallax.along, 0.7);
  EXPECT_GT(beside.result.parallax.deviations, 8);
  ASSERT_FALSE(beside.result.warnings.empty());
  EXPECT_THAT(beside.result.warnings.front(), HasSubstr("evidently not turned about its projection centre"));
}

TEST(Panoramic, WithstandsWrongMatches) {
  const Trial t = run(2, {.noise_px = 0.5, .wrong_share = 0.05});
  EXPECT_NEAR(t.result.sigma_px, 0.5, 0.03);
  EXPECT_LT(t.error.focal_px, 5 * t.result.sigma(kFocal));
  EXPECT_LT(t.error.edge_px, 1.5);
  // The same draws without wrong ones tell which they are.
  const PublishedCamera& c = t.camera;
  const SimulatedPanorama right =
      simulate_panorama(c.truth, c.width, c.height, {.images = 24, .subdivisions = 3, .noise_px = 0.5});
  const SimulatedPanorama with = simulate_panorama(
      c.truth, c.width, c.height, {.images = 24, .subdivisions = 3, .noise_px = 0.5, .wrong_share = 0.05});
  ASSERT_EQ(with.tracks.image, right.tracks.image);
  int wrong = 0, kept = 0;
  for (std::size_t r = 0; r < with.tracks.pixel.size(); ++r) {
    if ((with.tracks.pixel[r] - right.tracks.pixel[r]).norm() < 10) continue;
    ++wrong;
    kept += t.result.residuals[r].allFinite();
  }
  EXPECT_GT(wrong, 40);
  EXPECT_EQ(kept, 0);
}

// Other models of the same lens: those that can say it leave noise, those that cannot leave structure.
TEST(Panoramic, OtherModels) {
  const PublishedCamera& c = published_cameras()[2];
  const SimulatedPanorama panorama =
      simulate_panorama(c.truth, c.width, c.height, {.images = 24, .subdivisions = 3, .noise_px = 0.3});
  const auto calibrate = [&](const char* model, ParameterMask held = 0) {
    return calibrate_panoramic(panorama.tracks,
                               start_intrinsics(*find_model(model), 0.8 * c.truth[kFocal], c.width, c.height), c.width,
                               c.height, {.image_sigma_px = 0.3}, held);
  };
  for (const char* model : {"brown", "odd-radial-3"}) {
    const PanoramicResult result = calibrate(model);
    EXPECT_NEAR(result.sigma_px, 0.3, 0.01) << model;
    EXPECT_NEAR(result.camera[kFocal], c.truth[kFocal], 5 * result.sigma(kFocal) + 0.3) << model;
    EXPECT_GT(result.structure.probability, 0.01) << model;
  }
  const PanoramicResult pinhole = calibrate("pinhole");
  EXPECT_GT(pinhole.sigma_px, 0.5);
  EXPECT_LT(pinhole.structure.probability, 1e-6);
  ASSERT_FALSE(pinhole.warnings.empty());
  EXPECT_THAT(pinhole.warnings.back(), HasSubstr("structure"));
  const PanoramicResult held = calibrate("brown", mask_of(kDecentring1) | mask_of(kDecentring2));
  EXPECT_EQ(held.camera[kDecentring1], 0);
  EXPECT_EQ(held.sigma(kDecentring1), 0);
}

// Published for a real camera: RMS 5.787 px with one radial term, 1.271 with two, 0.482 with three.
TEST(Panoramic, ResidualsFallWithEveryRadialTermTheLensHas) {
  const PublishedCamera& c = published_cameras()[0];
  const SimulatedPanorama panorama =
      simulate_panorama(c.truth, c.width, c.height, {.images = 24, .subdivisions = 3, .noise_px = 0.34});
  std::vector<double> rms, probability;
  for (int terms = 0; terms <= 3; ++terms) {
    ParameterMask held = terms == 0 ? mask_of(kSymmetryX) | mask_of(kSymmetryY) : 0;
    for (int p = kRadialTerms + terms; p < c.truth.size(); ++p) held |= mask_of(p);
    const PanoramicResult result = calibrate_panoramic(panorama.tracks, published_start(c.truth, c.width, c.height),
                                                       c.width, c.height, {.image_sigma_px = 0.34}, held);
    rms.push_back(result.rms_px);
    probability.push_back(result.structure.probability);
  }
  EXPECT_GT(rms[0], 4 * rms[1]);
  EXPECT_GT(rms[1], 2 * rms[2]);
  EXPECT_GT(rms[2], rms[3]);
  EXPECT_LT(probability[1], 1e-6);
  EXPECT_GT(probability[3], 0.01);
}

template <typename Exception>
std::string message(const PanoramicTracks& tracks, const Intrinsics& start) {
  try {
    calibrate_panoramic(tracks, start, 1920, 1080);
  } catch (const Exception& error) {
    return error.what();
  }
  return "";
}

TEST(PanoramicBadInput, NamesCauseAndRemedy) {
  const PublishedCamera& c = published_cameras()[2];
  const Intrinsics start = published_start(c.truth, c.width, c.height);
  PanoramicTracks one;
  one.images = {"a.jpg"};
  EXPECT_THAT(message<InputError>(one, start), HasSubstr("at least two images"));

  SimulatedPanorama panorama =
      simulate_panorama(c.truth, c.width, c.height, {.images = 24, .subdivisions = 3, .noise_px = 0.3});
  PanoramicTracks apart = panorama.tracks;  // every measurement a track with an image of its own
  for (std::size_t r = 0; r < apart.image.size(); ++r) apart.image[r] = static_cast<int>(r);
  apart.images.assign(apart.image.size(), "x");
  EXPECT_THAT(message<InputError>(apart, start), HasSubstr("no two of the"));

  panorama.tracks.images.push_back("alone.jpg");
  const PanoramicResult result = calibrate_panoramic(panorama.tracks, start, c.width, c.height);
  ASSERT_FALSE(result.warnings.empty());
  EXPECT_THAT(result.warnings.front(), HasSubstr("alone.jpg: left out"));
  EXPECT_EQ(result.linked.back(), 0);
}

TEST(PanoramicBadInput, RefusesWhatImagesDoNotDetermine) {
  const PublishedCamera& c = published_cameras()[2];
  const Intrinsics start = published_start(c.truth, c.width, c.height);
  // Twice the same direction: nothing tells the focal length.
  PanoramicTracks still;
  still.images = {"a", "b"};
  Random random(1, Random::Purpose::kTracks);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2d pixel(random.uniform(20, 1900), random.uniform(20, 1060));
    for (int image = 0; image < 2; ++image) {
      still.image.push_back(image);
      still.pixel.push_back(pixel + 0.3 * Eigen::Vector2d(random.normal(), random.normal()));
    }
    still.begin.push_back(std::ssize(still.image));
  }
  EXPECT_THAT(message<ComputeError>(still, start), HasSubstr("do not determine"));

  const SimulatedPanorama few =
      simulate_panorama(c.truth, c.width, c.height, {.images = 6, .subdivisions = 1, .noise_px = 0.3});
  PanoramicOptions options;
  options.min_common = 3;
  EXPECT_THROW(calibrate_panoramic(few.tracks, start_intrinsics(*find_model("fourier-2"), 1100, c.width, c.height),
                                   c.width, c.height, options),
               Error);
}

}  // namespace
}  // namespace megablock
