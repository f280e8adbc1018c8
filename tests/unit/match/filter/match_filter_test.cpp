// The match filter: its share of correct answers on simulated streets, against that published by Cannelle (2013).
#include "match/filter/match_filter.h"

#include <gtest/gtest.h>

#include <fstream>

#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"
#include "match/filter/filter_training.h"

namespace megablock {
namespace {

// `calibrated`: cameras and mounts are known, as for the published figures; otherwise they are nominal.
std::vector<LabelledMatch> street(std::uint64_t seed, bool calibrated) {
  SimulationOptions options = SimulationOptions::of(SimulationOptions::Scene::kStereopolis);
  options.frames = 120;
  options.calibrate = !calibrated;
  options.seed = seed;
  options.outlier_share = 0.15;
  options.bridge = false;
  const SimulatedBlock simulated = simulate_block(options);
  return labelled_matches(simulated.block, simulated.tracks, simulated.outlier, {}, 1);
}

TrainedFilter train(const std::vector<LabelledMatch>& matches, const std::vector<MatchFeature>& features) {
  TrainingOptions options;
  options.features = features;
  options.samples = 186;
  return train_filter(matches, options);
}

// The residual alone accepts wrong matches along the epipolar line. The distance rejects a part of them, the angle more
// (Cannelle 2013).
TEST(MatchFilter, DistanceAndAngleTellWhatTheResidualDoesNot) {
  using enum MatchFeature;
  const std::vector<LabelledMatch> matches = street(3, true);
  const TrainedFilter all = train(matches, {kReprojection, kDistance, kAngle});
  EXPECT_GE(all.correct, 0.921);  // as published
  EXPECT_GT(all.correct, train(matches, {kReprojection}).correct);
  EXPECT_GT(all.tested, 500);
  // The same samples give the same model.
  EXPECT_EQ(all.yaml, train(matches, {kReprojection, kDistance, kAngle}).yaml);
}

TEST(MatchFilter, TheShippedOneKnowsOtherStreets) {
  const MatchFilter filter = MatchFilter::shipped();
  for (const bool calibrated : {true, false}) {
    std::vector<MatchSample> samples[2];
    for (const LabelledMatch& match : street(8, calibrated)) samples[match.right].push_back(match.sample);
    for (const int kind : {0, 1}) {
      std::size_t correct = 0;
      for (const std::uint8_t right : filter.right(samples[kind])) correct += right == kind;
      const double share = static_cast<double>(correct) / static_cast<double>(samples[kind].size());
      EXPECT_GT(share, kind == 1 ? 0.95 : calibrated ? 0.85 : 0.75) << calibrated << ' ' << kind;
    }
  }
  EXPECT_TRUE(filter.right({}).empty());
}

TEST(MatchFilter, WhatIsNoModelIsRefused) {
  EXPECT_THROW(MatchFilter("%YAML:1.0\n---\nfeatures: [ 0 ]\n"), InputError);
  EXPECT_THROW(MatchFilter("nonsense"), InputError);
  EXPECT_THROW(MatchFilter::load("/nowhere/model.yaml"), InputError);
  const std::vector<LabelledMatch> few(40);
  EXPECT_THROW(train_filter(few, {}), InputError);
}

}  // namespace
}  // namespace megablock
