// Tracks = connected components of the matches; a component that sees an image twice is split into consistent parts.
//
// Matches are taken in the order of match_order.h, and each unites the tracks of its two features unless the union
// would see an image twice. So tracks do not depend on the cells in which pairs were matched.
//
// Memory: 8 bytes per matched feature, besides matched_features.h and match_order.h; nothing per match.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "io/block/features.h"
#include "io/block/tracks.h"
#include "match/tracks/match_order.h"
#include "match/tracks/matched_features.h"

namespace megablock {

struct TrackOptions {
  int min_length = 2;               // images
  bool remove_eccentricity = true;  // of keypoints (eccentricity.h); whoever measures the tracks does it
  void check() const;               // throws InputError
};

// One track: ascending images, and the row of each in its features.
struct Track {
  FeatureNumber first;  // number of its first feature, by which TrackBuilder finds it again
  std::vector<ImageIndex> images;
  std::vector<std::int32_t> features;
};

// Builds tracks from pairs in batches ("generations"), as a block that grows brings them: what earlier generations
// united stays united, so that a later one changes no tracks but those its own matches touch.
class TrackBuilder {
 public:
  explicit TrackBuilder(std::size_t images, MatchMemory memory = {});
  ~TrackBuilder();
  // In any order. InputError for pairs that name images or features that cannot be.
  void add(const VerifiedPair& pair, std::int32_t generation = 0);
  // Once, after all pairs.
  void build();

  // Tracks of at least `min_length` images, by first image, then first feature.
  void visit(int min_length, const std::function<void(const Track&)>& visit) const;
  Track track(FeatureNumber first) const;
  // How many tracks of three and more images each image had when the generation, or the last one before it that
  // brought pairs, had been added.
  const IndexedVector<ImageIndex, std::int64_t>& long_tracks(std::int32_t generation) const;

 private:
  class FeatureSets;
  void count_long_tracks(std::int32_t generation);
  void fill(FeatureNumber first, Track& track) const;

  MatchedFeatures features_;
  MatchOrder order_;
  std::unique_ptr<FeatureSets> sets_;
  std::vector<IndexedVector<ImageIndex, std::int64_t>> long_tracks_;  // by generation
};

// All pairs in one batch, with the positions of the keypoints. Ids are 0..n-1, ordered by first image, then first
// feature. InputError also for features that do not exist.
TrackSet build_tracks(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                      const std::vector<VerifiedPair>& pairs, const TrackOptions& options);

}  // namespace megablock
