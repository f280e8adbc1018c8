#include "adjust/calibration/model_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "adjust/calibration/block_sample.h"
#include "adjust/calibration/camera_fit.h"
#include "adjust/calibration/residual_structure.h"
#include "io/base/error.h"
#include "io/simulate/blocks/panorama.h"
#include "io/simulate/scene/published_cameras.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/scene/random.h"

namespace megablock {
namespace {

using testing::HasSubstr;

std::vector<ResidualAtPixel> noise(int count, std::uint64_t seed) {
  std::vector<ResidualAtPixel> residuals;
  Random random(seed, Random::Purpose::kNoise);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d pixel(random.uniform(0, 1920), random.uniform(0, 1080));
    residuals.push_back({pixel, 0.5 * Eigen::Vector2d(random.normal(), random.normal())});
  }
  return residuals;
}

// Under noise the probability is uniform: its mean over 60 draws is 0.5 +- 0.037.
TEST(ResidualStructure, NoiseHasNone) {
  double sum = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed)
    sum += residual_structure(noise(3000, seed), 1920, 1080, 0).probability;
  EXPECT_NEAR(sum / 60, 0.5, 3 * 0.037);
}

TEST(ResidualStructure, MeasuresAFieldThatIsThere) {
  std::vector<ResidualAtPixel> residuals = noise(4000, 1);
  double squares = 0;
  for (ResidualAtPixel& r : residuals) {
    const Eigen::Vector2d field(0.1 * std::sin(r.pixel.x() / 300), 0.05 * std::cos(r.pixel.y() / 200));
    r.residual += field;
    squares += field.squaredNorm();
  }
  const ResidualStructure s = residual_structure(residuals, 1920, 1080, 0);
  EXPECT_LT(s.probability, 1e-4);
  EXPECT_NEAR(s.structure_px, std::sqrt(squares / 4000), 0.015);
}

TEST(ResidualStructure, TooFewResidualsTellNothing) {
  const ResidualStructure s = residual_structure(noise(5, 1), 1920, 1080, 8);
  EXPECT_EQ(s.degrees, 0);
  EXPECT_EQ(s.probability, 1);
}

TEST(CameraFit, FindsTheSameCameraInTheSameModel) {
  const PublishedCamera& c = published_cameras()[2];
  const CameraFit fit = fit_camera(c.truth.model(), ~ParameterMask{0}, c.truth, c.width, c.height);
  EXPECT_LT(fit.rms_px, 1e-6);
  const CameraFit odd = fit_camera(*find_model("odd-radial-3"), ~ParameterMask{0}, c.truth, c.width, c.height);
  EXPECT_LT(odd.rms_px, 1e-6);  // the same in other units
}

// A model with more terms fits better, one without distortion leaves all of it.
TEST(CameraFit, LeavesWhatTheModelCannotSay) {
  const PublishedCamera& c = published_cameras()[0];
  double before = 100;
  for (const char* name : {"pinhole", "ign-radial/1", "ign-radial/2", "ign-radial"}) {
    const ModelCandidate candidate = find_candidate(name);
    const double rms = fit_camera(candidate.model, candidate.free, c.truth, c.width, c.height).rms_px;
    EXPECT_LT(rms, 0.7 * before) << name;
    before = rms;
  }
}

TEST(ModelCandidates, Names) {
  EXPECT_EQ(find_candidate("brown/2").parameters(), 5);
  EXPECT_EQ(find_candidate("brown").parameters(), 8);
  EXPECT_EQ(find_candidate("ign-radial/1").parameters(), 6);
  EXPECT_EQ(find_candidate("pinhole").parameters(), 3);
  EXPECT_THROW(find_candidate("brwn"), InputError);
  EXPECT_THROW(find_candidate("brown/4"), InputError);
  EXPECT_THROW(find_candidate("pinhole/1"), InputError);
  EXPECT_THROW(find_candidate("equirectangular"), InputError);
  EXPECT_THROW(default_candidates(*find_model("equirectangular")), InputError);
  for (const ModelCandidate& candidate : default_candidates(*find_model("opencv-fisheye")))
    EXPECT_THAT(candidate.name, HasSubstr("fisheye"));
}

SimulationOptions aerial() {
  SimulationOptions options;
  options.frames = 20;
  options.points_per_frame = 250;
  options.outlier_share = 0.01;
  return options;
}

ModelComparison compare(const SimulationOptions& simulation, const std::vector<const char*>& names) {
  const SimulatedBlock block = simulate_block(simulation);
  std::vector<ModelCandidate> candidates;
  for (const char* name : names) candidates.push_back(find_candidate(name));
  return compare_models(block.block, initial_state(block.block), block.tracks, candidates, {});
}

const ModelTrial& recommended(const ModelComparison& comparison) {
  return comparison.trials[static_cast<std::size_t>(comparison.recommended.front())];
}
double rms(const ModelComparison& comparison, const std::string& name) {
  for (const ModelTrial& trial : comparison.trials)
    if (trial.candidate.name == name && trial.failure.empty()) return trial.cameras.front().rms_px;
  return -1;
}

// Published for a real camera: RMS 5.787 px with one term, 1.271 with two, 0.482 with three.
TEST(ModelComparison, TheThesisCameraNeedsThreeRadialTerms) {
  SimulationOptions options = aerial();
  options.use_published_camera(1);
  const ModelComparison c = compare(options, {"pinhole", "ign-radial/1", "ign-radial/2", "ign-radial", "legendre-5"});
  EXPECT_GT(rms(c, "pinhole"), rms(c, "ign-radial/1"));
  EXPECT_GT(rms(c, "ign-radial/1"), 1.3 * rms(c, "ign-radial/2"));
  EXPECT_GT(rms(c, "ign-radial/2"), rms(c, "ign-radial"));
  EXPECT_EQ(recommended(c).candidate.name, "ign-radial");
  EXPECT_TRUE(c.without_structure.front());
  EXPECT_NEAR(recommended(c).sigma_px, 0.5, 0.02);
}

TEST(ModelComparison, RecommendsTheSimulatedModelOrASmallerOne) {
  SimulationOptions options = aerial();  // k1, k2, p1, p2
  const ModelComparison c = compare(options, {"pinhole", "brown/1", "brown/2", "brown", "legendre-5"});
  // The principal point does what so little decentring does.
  EXPECT_THAT(recommended(c).candidate.name, testing::AnyOf("brown/2", "brown"));
  EXPECT_TRUE(c.without_structure.front());
  options.distortion = false;
  const ModelComparison straight = compare(options, {"pinhole", "brown/1", "brown", "legendre-5"});
  EXPECT_EQ(recommended(straight).candidate.name, "pinhole");
}

// A correction without symmetry: no radial model is enough.
TEST(ModelComparison, SeesThatALensIsNotRadial) {
  SimulationOptions options = aerial();
  options.camera_model = "polynomial-3";
  const ModelComparison c = compare(options, {"brown", "ign-radial", "polynomial-3", "legendre-5"});
  EXPECT_EQ(recommended(c).candidate.name, "polynomial-3");
  EXPECT_TRUE(c.without_structure.front());
}

TEST(ModelComparison, BadInput) {
  const SimulatedBlock block = simulate_block(aerial());
  const BlockState state = initial_state(block.block);
  EXPECT_THROW(compare_models(block.block, state, block.tracks, {}, {}), InputError);
  BlockState nothing = state;
  std::fill(nothing.oriented.begin(), nothing.oriented.end(), 0);
  EXPECT_THROW(compare_models(block.block, nothing, block.tracks, {find_candidate("brown")}, {}), InputError);
}

TEST(BlockSample, IsConnectedAndSmallEnough) {
  SimulationOptions options = aerial();
  options.frames = 60;
  const SimulatedBlock block = simulate_block(options);
  const BlockSample sample = sample_block(block.block, initial_state(block.block), block.tracks, {12, 1500});
  EXPECT_EQ(sample.frames, 12);
  EXPECT_EQ(std::count(sample.state.oriented.begin(), sample.state.oriented.end(), 1), 12);
  EXPECT_LE(sample.tracks.observation_count(), 1600);
  EXPECT_GT(sample.tracks.observation_count(), 700);
  for (const ImageIndex image : sample.tracks.image)
    EXPECT_TRUE(sample.state.oriented[block.block.images[image].frame]);
}

}  // namespace
}  // namespace megablock
