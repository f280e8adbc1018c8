// Acceptance tests of "Bundle adjustment with known positions" (A. Barrier, S. Martin) that concern tracks: building
// them from pairs, choosing images by their common points, thresholds of the verification.
#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <map>
#include <random>
#include <set>

#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "known_positions_scene.h"
#include "match/pairs/pair_matching.h"
#include "match/tracks/common_tracks.h"
#include "match/tracks/tracks.h"
#include "match/verification/two_view.h"
#include "reached.h"

namespace megablock {
namespace {

using ImageFeature = std::pair<std::int64_t, std::int32_t>;  // image, feature
using FeatureSets = std::set<std::vector<ImageFeature>>;

constexpr std::int64_t kImages = 20;
constexpr std::int32_t kFeatures = 400;

IndexedVector<ImageIndex, std::vector<Keypoint>> keypoints() {
  IndexedVector<ImageIndex, std::vector<Keypoint>> all(kImages);
  std::int32_t place = 0;
  for (auto& points : all)
    for (std::int32_t i = 0; i < kFeatures; ++i) points.push_back({++place, 2 * place, 3, 0});
  return all;
}

// Feature i of every image that sees point i; a point is matched in a share of its pairs of images.
std::vector<VerifiedPair> incomplete_pairs(std::mt19937_64& random) {
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<std::int32_t>> matches;
  std::uniform_real_distribution<double> unit(0, 1);
  for (std::int32_t point = 0; point < kFeatures; ++point) {
    std::vector<std::int64_t> seen;
    for (std::int64_t image = 0; image < kImages; ++image)
      if (unit(random) < 0.3) seen.push_back(image);
    for (std::size_t a = 0; a < seen.size(); ++a)
      for (std::size_t b = a + 1; b < seen.size(); ++b)
        if (unit(random) < 0.5) matches[{seen[a], seen[b]}].push_back(point);
  }
  std::vector<VerifiedPair> pairs;
  for (const auto& [images, features] : matches) {
    VerifiedPair pair;
    pair.a = ImageIndex(images.first);
    pair.b = ImageIndex(images.second);
    pair.model = PairModel::kEssential;
    pair.feature_a = pair.feature_b = features;
    pairs.push_back(pair);
  }
  return pairs;
}

// Connected components, by walking through the graph.
FeatureSets components_of(const std::vector<VerifiedPair>& pairs) {
  std::map<ImageFeature, std::vector<ImageFeature>> edges;
  for (const VerifiedPair& pair : pairs)
    for (std::size_t m = 0; m < pair.feature_a.size(); ++m) {
      const ImageFeature a{pair.a.value, pair.feature_a[m]}, b{pair.b.value, pair.feature_b[m]};
      edges[a].push_back(b);
      edges[b].push_back(a);
    }
  FeatureSets components;
  std::set<ImageFeature> done;
  for (const auto& [start, ignored] : edges) {
    if (!done.insert(start).second) continue;
    std::vector<ImageFeature> component{start};
    for (std::size_t i = 0; i < component.size(); ++i)
      for (const ImageFeature& next : edges[component[i]])
        if (done.insert(next).second) component.push_back(next);
    std::sort(component.begin(), component.end());
    components.insert(component);
  }
  return components;
}

FeatureSets tracks_of(const std::vector<VerifiedPair>& pairs) {
  const TrackSet set = build_tracks(keypoints(), pairs, {});
  FeatureSets tracks;
  for (std::size_t t = 0; t < set.id.size(); ++t) {
    std::vector<ImageFeature> track;
    for (std::int64_t o = set.begin[t]; o < set.begin[t + 1]; ++o)
      track.emplace_back(set.image[static_cast<std::size_t>(o)].value, set.feature[static_cast<std::size_t>(o)]);
    tracks.insert(track);
  }
  return tracks;
}

TEST(KnownPositionsTracks, TKP11IncompletePairListsGiveTheConnectedComponents) {
  std::mt19937_64 random(11);
  std::vector<VerifiedPair> pairs = incomplete_pairs(random);
  const FeatureSets expected = components_of(pairs);
  EXPECT_EQ(tracks_of(pairs), expected);
  std::shuffle(pairs.begin(), pairs.end(), random);
  EXPECT_EQ(tracks_of(pairs), expected);
}

TEST(KnownPositionsTracks, TKP11FalseMergesDoNotPutAnImageTwiceIntoATrack) {
  std::mt19937_64 random(12);
  std::vector<VerifiedPair> pairs = incomplete_pairs(random);
  for (VerifiedPair& pair : pairs)
    for (std::int32_t& feature : pair.feature_b)
      if (random() % 50 == 0) feature = static_cast<std::int32_t>(random() % kFeatures);
  const FeatureSets tracks = tracks_of(pairs);
  EXPECT_GT(tracks.size(), 300u);
  for (const std::vector<ImageFeature>& track : tracks)
    for (std::size_t i = 1; i < track.size(); ++i) ASSERT_LT(track[i - 1].first, track[i].first);
  std::shuffle(pairs.begin(), pairs.end(), random);
  EXPECT_EQ(tracks_of(pairs), tracks);
}

// Processor time, seconds, of building tracks of images that follow one another, 200 matches each: every point is seen
// by five, and each image matches its four successors.
double track_seconds(std::int64_t images) {
  constexpr std::int32_t kPoints = 100, kLength = 5;
  TrackBuilder builder(static_cast<std::size_t>(images + kLength));
  VerifiedPair pair;
  pair.model = PairModel::kEssential;
  const std::clock_t begun = std::clock();
  for (std::int64_t a = 0; a < images; ++a)
    for (std::int64_t b = a + 1; b < a + kLength; ++b) {
      pair.a = ImageIndex(a);
      pair.b = ImageIndex(b);
      pair.feature_a.clear();
      for (std::int32_t row = 0; row < kPoints; ++row)
        if ((a + row) / kLength == (b + row) / kLength) pair.feature_a.push_back(row);
      pair.feature_b = pair.feature_a;
      builder.add(pair);
    }
  builder.build();
  return static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
}

// Eight times as many matches take eight times as long; a quadratic step would take 64 times. What else the computer
// does moves the median of several ratios little.
TEST(KnownPositionsTracks, TKP11TimeGrowsLinearly) {
  std::vector<double> ratios;
  for (int repetition = 0; repetition < 7; ++repetition) ratios.push_back(track_seconds(8000) / track_seconds(1000));
  expect_at_most(median(ratios), 16, "time for eight times as many matches, median of seven");
}

// Every pair of the six images of a scene with all of its points, image coordinates with a noise of 0.1 px; row =
// point. Kept is what the verification keeps at a threshold, everything without one.
std::vector<VerifiedPair> verified_pairs(const KnownPositionsScene& scene, double max_residual_px) {
  std::vector<VerifiedPair> pairs;
  for (std::size_t a = 0; a < scene.centres.size(); ++a)
    for (std::size_t b = a + 1; b < scene.centres.size(); ++b) {
      PointPairs points;
      for (const std::vector<Eigen::Vector2d>& image : scene.images) {
        points.a.push_back(image[a] / scene.focal);
        points.b.push_back(image[b] / scene.focal);
      }
      TwoViewOptions options;
      options.max_residual = max_residual_px / scene.focal;
      options.seed = 100 * a + b;
      const std::vector<std::uint8_t> kept =
          max_residual_px > 0 ? estimate_two_view(points, options).inlier : std::vector<std::uint8_t>(points.size(), 1);
      VerifiedPair pair;
      pair.a = ImageIndex(static_cast<std::int64_t>(a));
      pair.b = ImageIndex(static_cast<std::int64_t>(b));
      pair.model = PairModel::kEssential;
      for (std::size_t i = 0; i < kept.size(); ++i)
        if (kept[i]) pair.feature_a.push_back(static_cast<std::int32_t>(i));
      pair.feature_b = pair.feature_a;
      pairs.push_back(pair);
    }
  return pairs;
}

struct SurvivingTracks {
  double matches = 0, tracks = 0, complete = 0;  // shares: of the matches; of the points, as tracks of six images, and
                                                 // with the matches of all fifteen pairs
};
SurvivingTracks surviving_tracks(const KnownPositionsScene& scene, double max_residual_px) {
  const std::vector<VerifiedPair> pairs = verified_pairs(scene, max_residual_px);
  IndexedVector<ImageIndex, std::vector<Keypoint>> features(scene.centres.size());
  std::int32_t place = 0;
  for (auto& points : features)
    for (std::size_t i = 0; i < scene.points.size(); ++i) points.push_back({++place, 2 * place, 3, 0});
  const TrackSet tracks = build_tracks(features, pairs, {});
  SurvivingTracks result;
  const auto points = static_cast<double>(scene.points.size());
  for (std::size_t t = 0; t < tracks.id.size(); ++t)
    result.tracks += (tracks.begin[t + 1] - tracks.begin[t] == 6 ? 1 : 0) / points;
  std::vector<std::size_t> times(scene.points.size(), 0);
  for (const VerifiedPair& pair : pairs)
    for (const std::int32_t point : pair.feature_a) ++times[static_cast<std::size_t>(point)];
  for (const std::size_t count : times) {
    result.matches += static_cast<double>(count) / static_cast<double>(pairs.size()) / points;
    result.complete += (count == pairs.size() ? 1 : 0) / points;
  }
  return result;
}

// A threshold of twice the noise loses a match in twenty; half of the noise more than half of the matches, many times
// more of the tracks.
TEST(KnownPositionsTracks, TKP13TracksFallFasterThanMatchesWithTheThreshold) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const KnownPositionsScene scene(KnownPositionsOptions::satellite(600, 0.1, seed));
    const SurvivingTracks all = surviving_tracks(scene, 0), usual = surviving_tracks(scene, 0.2),
                          narrow = surviving_tracks(scene, 0.05);
    for (const auto& [level, found] : {std::pair{"0.2 px", usual}, std::pair{"0.05 px", narrow}})
      std::printf("[ reached  ] at %s: %.1f %% of the matches, %.1f %% of the tracks of six images, %.2f %% complete\n",
                  level, 100 * found.matches, 100 * found.tracks, 100 * found.complete);
    EXPECT_NEAR(all.tracks, 1, 1e-9);
    expect_within(usual.matches, 0.95, 0.02, "share of matches that 0.2 px leave");
    expect_at_most(narrow.tracks, usual.tracks, "share of tracks that 0.05 px leave");
    EXPECT_LT(usual.complete, all.complete);
    expect_at_least(usual.tracks, 0.98, "share of tracks that 0.2 px leave");
    expect_at_most(narrow.complete / usual.complete, 0.25 * narrow.matches / usual.matches,
                   "complete tracks at 0.05 px over those at 0.2 px");
  }
}

// The default, which is for photographs of cameras with unknown distortion, is a threshold for these images too: it
// keeps all right matches, which 0.2 px does not, and still none of the wrong ones (every tenth) but by chance.
TEST(KnownPositionsTracks, TKP13DefaultThresholdTellsRightMatchesFromWrongOnes) {
  double right = 0, right_kept = 0, wrong = 0, wrong_kept = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const KnownPositionsScene scene(KnownPositionsOptions::satellite(600, 0.1, seed));
    for (std::size_t b = 1; b < scene.centres.size(); ++b) {
      PointPairs points;
      for (std::size_t i = 0; i < scene.images.size(); ++i) {
        points.a.push_back(scene.images[i][0] / scene.focal);
        points.b.push_back(scene.images[i % 10 == 0 ? (i + 5) % scene.images.size() : i][b] / scene.focal);
      }
      TwoViewOptions options;
      options.max_residual = MatchOptions().max_residual_px / scene.focal;
      options.seed = b;
      const TwoView found = estimate_two_view(points, options);
      for (std::size_t i = 0; i < points.size(); ++i) {
        (i % 10 == 0 ? wrong : right) += 1;
        (i % 10 == 0 ? wrong_kept : right_kept) += found.inlier[i];
      }
    }
  }
  expect_at_least(right_kept / right, 0.999, "share of right matches kept");
  expect_at_most(wrong_kept / wrong, 0.002, "share of wrong matches kept");
}

// Five times six images of which all have about as many matches in pairs, but few, fewer and hardly any tracks in
// common.
TEST(KnownPositionsTracks, TKP12SubsetsAreRankedByTheTracksThatAllTheirImagesShare) {
  const std::vector<std::vector<std::int64_t>> tuples = {{7, 8, 9, 10, 11, 12},
                                                         {12, 13, 14, 18, 19, 20},
                                                         {2, 15, 16, 17, 18, 19},
                                                         {1, 2, 7, 8, 13, 14},
                                                         {1, 2, 3, 4, 5, 6}};
  const std::vector<std::int64_t> common = {88, 280, 2311, 185, 1193};
  TrackSet tracks;
  tracks.begin.push_back(0);
  const auto add = [&](const std::vector<std::int64_t>& images) {
    for (std::int64_t image : images) tracks.image.push_back(ImageIndex(image));
    tracks.begin.push_back(std::ssize(tracks.image));
  };
  std::vector<std::vector<ImageIndex>> subsets;
  for (std::size_t k = 0; k < tuples.size(); ++k) {
    for (std::int64_t n = 0; n < common[k]; ++n) add(tuples[k]);
    for (std::int64_t n = common[k]; n < 3000; ++n) {
      std::vector<std::int64_t> five = tuples[k];
      five.erase(five.begin() + n % 6);
      add(five);
    }
    subsets.emplace_back(tuples[k].rbegin(), tuples[k].rend());
    subsets.back().push_back(subsets.back().front());
  }
  const std::vector<ImageSubset> ranked = rank_by_common_tracks(tracks, subsets);
  ASSERT_EQ(ranked.size(), 5u);
  const std::int64_t counts[] = {2311, 1193, 280, 185, 88};
  for (std::size_t k = 0; k < 5; ++k)
    expect_within(static_cast<double>(ranked[k].common_tracks), static_cast<double>(counts[k]), 0,
                  "tracks that six images share, rank " + std::to_string(k + 1));
  EXPECT_EQ(ranked[0].images.front(), ImageIndex(2));
  const std::vector<ImageIndex> least(tuples[0].begin(), tuples[0].end());
  EXPECT_EQ(ranked[4].images, least);
  EXPECT_THROW(rank_by_common_tracks(tracks, {{}}), InputError);
}

}  // namespace
}  // namespace megablock
