// Tracks from matches: against a brute-force construction with sets, for random matches in any order and with little
// memory.
#include "match/tracks/tracks.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <random>
#include <set>
#include <string>
#include <tuple>

#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

using Keypoints = IndexedVector<ImageIndex, std::vector<Keypoint>>;

// Every feature has its own position.
Keypoints make_keypoints(std::size_t images, std::int32_t features) {
  Keypoints keypoints(images);
  std::int32_t place = 0;
  for (auto& points : keypoints) {
    for (std::int32_t i = 0; i < features; ++i) points.push_back({++place, 2 * place, 3, 0});
  }
  return keypoints;
}

VerifiedPair make_pair(std::int64_t a, std::int64_t b, const std::vector<std::pair<int, int>>& matches) {
  VerifiedPair pair;
  pair.a = ImageIndex(a);
  pair.b = ImageIndex(b);
  pair.model = PairModel::kEssential;
  for (const auto& [i, j] : matches) {
    pair.feature_a.push_back(i);
    pair.feature_b.push_back(j);
  }
  return pair;
}

using TrackImages = std::vector<std::pair<std::int64_t, std::int32_t>>;  // image, feature

std::vector<TrackImages> to_lists(const TrackSet& set) {
  std::vector<TrackImages> tracks;
  for (std::size_t t = 0; t < set.id.size(); ++t) {
    TrackImages track;
    for (auto i = static_cast<std::size_t>(set.begin[t]); i < static_cast<std::size_t>(set.begin[t + 1]); ++i) {
      track.emplace_back(set.image[i].value, set.feature[i]);
    }
    tracks.push_back(track);
  }
  return tracks;
}

std::vector<TrackImages> to_lists(const TrackBuilder& builder) {
  std::vector<TrackImages> tracks;
  builder.visit(2, [&](const megablock::Track& found) {
    TrackImages track;
    for (std::size_t i = 0; i < found.images.size(); ++i) track.emplace_back(found.images[i].value, found.features[i]);
    tracks.push_back(track);
    EXPECT_EQ(builder.track(found.first).images, found.images);
    EXPECT_EQ(builder.track(found.first).features, found.features);
  });
  return tracks;
}

TEST(Tracks, LaterBatchesDoNotUndoEarlierOnes) {
  TrackBuilder builder(4);
  builder.add(make_pair(0, 1, {{0, 0}}), 0);
  builder.add(make_pair(1, 2, {{0, 0}}), 0);
  // Stronger pairs, which would split the first track if they came together with it: image 3 sees 0 and 2 as two
  // features.
  builder.add(make_pair(0, 3, {{0, 0}, {1, 1}}), 2);
  builder.add(make_pair(2, 3, {{0, 1}, {1, 0}}), 2);
  builder.build();
  EXPECT_EQ(builder.long_tracks(0), (IndexedVector<ImageIndex, std::int64_t>({1, 1, 1, 0})));
  EXPECT_EQ(builder.long_tracks(1), builder.long_tracks(0)) << "brought no pairs";
  EXPECT_EQ(to_lists(builder).front(), (TrackImages{{0, 0}, {1, 0}, {2, 0}, {3, 0}}));
  EXPECT_EQ(builder.long_tracks(2)[ImageIndex(3)], 1);
  EXPECT_EQ(builder.long_tracks(9), builder.long_tracks(2)) << "the last one that brought pairs";
}

// Independent of the builder: sets as std::set, pairs sorted as the header says, no feature numbers.
std::vector<TrackImages> tracks_by_brute_force(std::vector<std::pair<int, VerifiedPair>> pairs) {
  std::sort(pairs.begin(), pairs.end(), [](const auto& p, const auto& q) {
    return std::tuple(p.first, q.second.feature_a.size(), p.second.a, p.second.b) <
           std::tuple(q.first, p.second.feature_a.size(), q.second.a, q.second.b);
  });
  std::vector<std::set<std::pair<std::int64_t, std::int32_t>>> sets;
  const auto set_of = [&](const std::pair<std::int64_t, std::int32_t>& feature) {
    auto found = std::find_if(sets.begin(), sets.end(), [&](const auto& s) { return s.contains(feature); });
    return found != sets.end() ? found : sets.insert(sets.end(), {feature});
  };
  for (const auto& [generation, pair] : pairs)
    for (std::size_t m = 0; m < pair.feature_a.size(); ++m) {
      set_of({pair.a.value, pair.feature_a[m]});
      const auto b = set_of({pair.b.value, pair.feature_b[m]}), a = set_of({pair.a.value, pair.feature_a[m]});
      std::set<std::int64_t> images;
      for (const auto& feature : *a) images.insert(feature.first);
      for (const auto& feature : *b) images.insert(feature.first);
      if (a == b || images.size() < a->size() + b->size()) continue;
      a->insert(b->begin(), b->end());
      sets.erase(b);
    }
  std::vector<TrackImages> tracks;
  for (const auto& set : sets)
    if (set.size() >= 2) tracks.emplace_back(set.begin(), set.end());
  std::sort(tracks.begin(), tracks.end());
  return tracks;
}

TEST(Tracks, EqualBruteForceHoweverLittleMemorySorts) {
  constexpr int kImages = 14, kFeatures = 700;  // rows beyond one group of words, and images without matches
  std::mt19937_64 generator(3);
  std::vector<std::pair<int, VerifiedPair>> pairs;
  for (int a = 0; a < kImages; ++a) {
    for (int b = a + 1; b < kImages; ++b) {
      if (a == 4 || b == 4 || generator() % 3 == 0) continue;
      std::vector<std::pair<int, int>> matches;
      for (int i = static_cast<int>(generator() % 40); i < kFeatures; i += 23)
        matches.emplace_back(i, generator() % 8 == 0 ? static_cast<int>(generator() % kFeatures) : i + b % 2);
      pairs.emplace_back(b > 9 ? 1 : 0, make_pair(a, b, matches));
    }
  }
  const std::vector<TrackImages> expected = tracks_by_brute_force(pairs);
  ASSERT_GT(expected.size(), 100u);
  const ScratchDirectory directory;
  const std::string scratch = directory.path("matches");
  for (const std::int64_t bytes : {std::int64_t{1} << 30, std::int64_t{4000}, std::int64_t{1}}) {
    std::shuffle(pairs.begin(), pairs.end(), generator);
    TrackBuilder builder(kImages, {bytes, scratch});
    for (const auto& [generation, pair] : pairs) builder.add(pair, generation);
    EXPECT_EQ(std::filesystem::exists(scratch), bytes < 5000);
    builder.build();
    EXPECT_EQ(to_lists(builder), expected) << bytes;
  }
  EXPECT_FALSE(std::filesystem::exists(scratch)) << "the scratch file is removed";
}

TEST(Tracks, AScratchFileThatCannotBeMadeIsNamed) {
  TrackBuilder builder(2, {1, "/dev/null/matches"});
  try {
    builder.add(make_pair(0, 1, {{0, 0}}));
    FAIL();
  } catch (const StoreError& error) {
    EXPECT_NE(std::string(error.what()).find("/dev/null/matches"), std::string::npos);
  }
}

TEST(Tracks, JoinMatchesOverImages) {
  const Keypoints keypoints = make_keypoints(4, 5);
  const TrackSet set = build_tracks(
      keypoints, {make_pair(2, 3, {{1, 1}}), make_pair(0, 2, {{4, 1}, {0, 0}}), make_pair(0, 1, {{4, 2}})}, {});
  EXPECT_EQ(to_lists(set), (std::vector<TrackImages>{{{0, 0}, {2, 0}}, {{0, 4}, {1, 2}, {2, 1}, {3, 1}}}));
  EXPECT_EQ(set.id, (std::vector<TrackIndex>{TrackIndex(0), TrackIndex(1)}));
  EXPECT_EQ(set.x[1], keypoints[ImageIndex(2)][0].x);
  EXPECT_EQ(set.y[1], keypoints[ImageIndex(2)][0].y);
}

TEST(Tracks, SplitWhereAnImageWouldBeSeenTwice) {
  // Strong pairs agree on one point in the images 0, 1, 2; the weak pair 0-2 links it to another feature of image 2.
  const Keypoints keypoints = make_keypoints(3, 5);
  const TrackSet set = build_tracks(
      keypoints,
      {make_pair(0, 2, {{0, 3}}), make_pair(0, 1, {{0, 0}, {1, 1}, {2, 2}}), make_pair(1, 2, {{0, 0}, {1, 1}})}, {});
  EXPECT_EQ(to_lists(set),
            (std::vector<TrackImages>{{{0, 0}, {1, 0}, {2, 0}}, {{0, 1}, {1, 1}, {2, 1}}, {{0, 2}, {1, 2}}}));
}

TEST(Tracks, RandomMatchesGiveConsistentTracksInAnyOrder) {
  constexpr int kImages = 12, kFeatures = 30;
  const Keypoints keypoints = make_keypoints(kImages, kFeatures);
  std::mt19937_64 generator(1);
  std::vector<VerifiedPair> pairs;
  for (int a = 0; a < kImages; ++a) {
    for (int b = a + 1; b < kImages; ++b) {
      std::vector<std::pair<int, int>> matches;
      for (int i = 0; i < kFeatures; ++i) {
        if (generator() % 3 == 0) continue;
        matches.emplace_back(i,
                             // A tenth is wrong.
                             generator() % 10 == 0 ? static_cast<int>(generator() % kFeatures) : i);
      }
      pairs.push_back(make_pair(a, b, matches));
    }
  }
  const TrackSet set = build_tracks(keypoints, pairs, {});
  std::set<std::pair<std::int64_t, std::int32_t>> seen;
  for (const TrackImages& track : to_lists(set)) {
    EXPECT_GE(track.size(), 2u);
    for (std::size_t i = 0; i < track.size(); ++i) {
      EXPECT_TRUE(seen.insert(track[i]).second) << "a feature in two tracks";
      if (i > 0) {
        EXPECT_LT(track[i - 1].first, track[i].first) << "images ascending and distinct";
      }
    }
  }
  const auto lists = to_lists(set);
  EXPECT_TRUE(std::is_sorted(lists.begin(), lists.end()));
  for (int round = 0; round < 5; ++round) {
    std::shuffle(pairs.begin(), pairs.end(), generator);
    EXPECT_EQ(to_lists(build_tracks(keypoints, pairs, {})), lists);
  }
}

TEST(Tracks, MinimumLength) {
  TrackOptions options;
  options.min_length = 3;
  const TrackSet set =
      build_tracks(make_keypoints(3, 3), {make_pair(0, 1, {{0, 0}, {1, 1}}), make_pair(1, 2, {{1, 2}})}, options);
  EXPECT_EQ(to_lists(set), (std::vector<TrackImages>{{{0, 1}, {1, 1}, {2, 2}}}));
  options.min_length = 1;
  EXPECT_THROW(build_tracks(make_keypoints(1, 1), {}, options), InputError);
}

TEST(Tracks, NothingMatchedGivesNone) {
  const TrackSet set = build_tracks(make_keypoints(2, 3), {}, {});
  EXPECT_EQ(set.track_count(), 0);
  EXPECT_EQ(set.begin, std::vector<std::int64_t>{0});
}

TEST(Tracks, BadPairsAreRefused) {
  const Keypoints keypoints = make_keypoints(2, 3);
  EXPECT_THROW(build_tracks(keypoints, {make_pair(0, 2, {{0, 0}})}, {}), ComputeError);
  EXPECT_THROW(build_tracks(keypoints, {make_pair(0, 1, {{0, 3}})}, {}), InputError);
  EXPECT_THROW(build_tracks(keypoints, {make_pair(0, 1, {{-1, 0}})}, {}), ComputeError);
  VerifiedPair uneven = make_pair(0, 1, {{0, 0}});
  uneven.feature_b.push_back(1);
  EXPECT_THROW(build_tracks(keypoints, {uneven}, {}), InputError);
}

}  // namespace
}  // namespace megablock
