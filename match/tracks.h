// Tracks = connected components of the matches; a component that sees an image twice is split into consistent parts.
#pragma once

#include <memory>
#include <vector>

#include "io/features.h"
#include "io/tracks.h"

namespace megablock {

struct TrackOptions {
  int min_length = 2;               // images
  bool remove_eccentricity = true;  // of keypoints (eccentricity.h); the pipeline does it, not the builder below
  void check() const;  // throws InputError
};

class FeatureSets;

// Builds tracks from pairs that come in batches, as a block that grows brings them: what earlier batches united stays
// united, so that a batch changes no tracks but those its own matches touch. Keypoints are indexed by image (rows of
// the result refer to them) and must outlive the builder.
class TrackBuilder {
 public:
  explicit TrackBuilder(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints);
  ~TrackBuilder();
  // Independent of the order of `pairs`. InputError for pairs that name images or features that do not exist.
  void add(const std::vector<VerifiedPair>& pairs);
  // How many tracks of three and more images each image has so far.
  IndexedVector<ImageIndex, std::int64_t> long_tracks() const;
  // Ids are 0..n-1, ordered by first image, then first feature.
  TrackSet tracks(const TrackOptions& options) const;

 private:
  const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints_;
  std::vector<std::vector<std::int32_t>> canonical_;  // [image][feature] lowest row at the feature's position
  std::unique_ptr<FeatureSets> sets_;
};

// All pairs in one batch.
TrackSet build_tracks(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                      const std::vector<VerifiedPair>& pairs, const TrackOptions& options);

}  // namespace megablock
