#include "match/tracks/tracks.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "io/base/error.h"

namespace megablock {

void TrackOptions::check() const {
  if (min_length < 2) throw InputError("min_track_length must be at least 2, not " + std::to_string(min_length));
}

// Sets of matched features (union-find). Each set is also a linked list in ascending order of features, which is
// ascending order of images. The root of a set is its first feature.
class TrackBuilder::FeatureSets {
 public:
  static constexpr FeatureNumber kNone = std::numeric_limits<FeatureNumber>::max();

  explicit FeatureSets(const MatchedFeatures& features)
      : features_(features),
        parent_(static_cast<std::size_t>(features.count())),
        next_(static_cast<std::size_t>(features.count()), kNone) {
    std::iota(parent_.begin(), parent_.end(), FeatureNumber{0});
  }

  bool is_root(FeatureNumber n) const { return parent_[n] == n; }
  FeatureNumber next(FeatureNumber n) const { return next_[n]; }
  bool has_length(FeatureNumber root, int length) const {
    FeatureNumber n = root;
    for (; length > 0 && n != kNone; --length) n = next_[n];
    return length == 0;
  }

  // Unites two sets, unless the union would contain an image twice.
  void unite(FeatureNumber one, FeatureNumber other) {
    const FeatureNumber a = root(one), b = root(other);
    if (a == b || share_image(a, b)) return;
    merge_lists(a, b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  FeatureNumber root(FeatureNumber n) {
    while (parent_[n] != n) {
      parent_[n] = parent_[parent_[n]];
      n = parent_[n];
    }
    return n;
  }

  // Walks both lists in parallel, as in a merge.
  bool share_image(FeatureNumber i, FeatureNumber j) const {
    ImageIndex image_i = features_.image_of(i), image_j = features_.image_of(j);
    while (image_i != image_j) {
      FeatureNumber& behind = image_i < image_j ? i : j;
      behind = next_[behind];
      if (behind == kNone) return false;
      (image_i < image_j ? image_i : image_j) = features_.image_of(behind);
    }
    return true;
  }

  void merge_lists(FeatureNumber i, FeatureNumber j) {
    FeatureNumber last = kNone;
    while (i != kNone || j != kNone) {  // kNone is above all numbers
      FeatureNumber& smaller = i < j ? i : j;
      const FeatureNumber taken = smaller;
      smaller = next_[taken];
      if (last != kNone) next_[last] = taken;
      last = taken;
    }
  }

  const MatchedFeatures& features_;
  std::vector<FeatureNumber> parent_, next_;
};

TrackBuilder::TrackBuilder(std::size_t images, MatchMemory memory) : features_(images), order_(std::move(memory)) {}

TrackBuilder::~TrackBuilder() = default;

void TrackBuilder::add(const VerifiedPair& pair, std::int32_t generation) {
  order_.add(pair, generation);
  features_.mark(pair.a, pair.feature_a);
  features_.mark(pair.b, pair.feature_b);
}

void TrackBuilder::build() {
  features_.number();
  sets_ = std::make_unique<FeatureSets>(features_);
  // Pairs arrive by generation; the numbers of long tracks are counted whenever a generation is complete.
  std::int32_t current = 0;
  order_.visit([&](const PairMatches& pair) {
    for (; current < pair.generation; ++current) count_long_tracks(current);
    for (std::size_t m = 0; m < pair.feature_a.size(); ++m)
      sets_->unite(features_.number_of(pair.a, pair.feature_a[m]), features_.number_of(pair.b, pair.feature_b[m]));
  });
  count_long_tracks(current);
}

void TrackBuilder::fill(FeatureNumber first, Track& track) const {
  track.first = first;
  track.images.clear();
  track.features.clear();
  for (FeatureNumber n = first; n != FeatureSets::kNone; n = sets_->next(n)) {
    track.images.push_back(features_.image_of(n));
    track.features.push_back(features_.row_of(n));
  }
}

Track TrackBuilder::track(FeatureNumber first) const {
  Track track;
  fill(first, track);
  return track;
}

void TrackBuilder::visit(int min_length, const std::function<void(const Track&)>& visit) const {
  if (min_length < 2) throw InputError("min_length of tracks must be at least 2");
  Track track;
  const auto count = static_cast<FeatureNumber>(features_.count());
  for (FeatureNumber n = 0; n < count; ++n) {
    if (!sets_->is_root(n) || !sets_->has_length(n, min_length)) continue;
    fill(n, track);
    visit(track);
  }
}

void TrackBuilder::count_long_tracks(std::int32_t generation) {
  IndexedVector<ImageIndex, std::int64_t> count(features_.image_count(), 0);
  visit(3, [&](const Track& track) {
    for (const ImageIndex image : track.images) ++count[image];
  });
  long_tracks_.resize(static_cast<std::size_t>(generation) + 1);
  long_tracks_.back() = std::move(count);
}

const IndexedVector<ImageIndex, std::int64_t>& TrackBuilder::long_tracks(std::int32_t generation) const {
  return long_tracks_[std::min(static_cast<std::size_t>(generation), long_tracks_.size() - 1)];
}

TrackSet build_tracks(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                      const std::vector<VerifiedPair>& pairs, const TrackOptions& options) {
  TrackBuilder builder(keypoints.size());
  for (const VerifiedPair& pair : pairs) builder.add(pair);
  builder.build();
  TrackSet tracks;
  tracks.begin.push_back(0);
  builder.visit(options.min_length, [&](const Track& track) {
    for (std::size_t i = 0; i < track.images.size(); ++i) {
      const auto& own = keypoints[track.images[i]];
      const auto row = static_cast<std::size_t>(track.features[i]);
      if (row >= own.size())
        throw InputError("matches of image " + std::to_string(track.images[i].value) + ": feature " +
                         std::to_string(row) + " does not exist");
      tracks.image.push_back(track.images[i]);
      tracks.x.push_back(own[row].x);
      tracks.y.push_back(own[row].y);
      tracks.feature.push_back(track.features[i]);
    }
    tracks.id.push_back(TrackIndex(tracks.track_count()));
    tracks.begin.push_back(static_cast<std::int64_t>(tracks.image.size()));
  });
  return tracks;
}

}  // namespace megablock
