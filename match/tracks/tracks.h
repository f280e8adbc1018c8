// Builds tracks: the connected components of the matches. A component that would contain an image twice is split into
// consistent parts.
//
// Matches are taken in the order of match_order.h. Each unites the tracks of its two features, unless the union would
// contain an image twice. As that order does not depend on the cells in which pairs were matched, neither do the
// tracks.
//
// Memory: 8 bytes per matched feature, besides that of matched_features.h and match_order.h; nothing per match.
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
  int min_length = 2;               // smallest number of images of a track
  bool remove_eccentricity = true;  // of keypoints (eccentricity.h); done where the tracks are written
  void check() const;               // throws InputError
};

// One track: its images, ascending, and for each the row of its feature.
struct Track {
  FeatureNumber first;  // number of its first feature, which identifies the track
  std::vector<ImageIndex> images;
  std::vector<std::int32_t> features;
};

// Builds tracks from pairs that come in batches ("generations"), as in a block that grows. Features that an earlier
// generation united stay united; a later one changes only the tracks that its own matches touch.
class TrackBuilder {
 public:
  explicit TrackBuilder(std::size_t images, MatchMemory memory = {});
  ~TrackBuilder();
  // Adds the matches of a pair, in any order. Throws ComputeError for images or features that cannot exist, and
  // InputError for a pair whose parts do not fit together.
  void add(const VerifiedPair& pair, std::int32_t generation = 0);
  // Builds the tracks. Call once, after all pairs.
  void build();

  // Calls `visit` for the tracks of at least `min_length` images, ordered by first image, then first feature.
  void visit(int min_length, const std::function<void(const Track&)>& visit) const;
  Track track(FeatureNumber first) const;
  // For each image the number of tracks of three and more images after this generation (or the last one before it that
  // brought pairs).
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

// Builds tracks from all pairs in one batch, with the positions of the keypoints. Ids are 0 to n - 1, ordered by first
// image, then first feature. Throws InputError also for features that do not exist.
TrackSet build_tracks(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                      const std::vector<VerifiedPair>& pairs, const TrackOptions& options);

}  // namespace megablock
