#include "match/tracks.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "io/error.h"

namespace megablock {

// Every feature is a node; nodes of one image follow one another. Sets are linked lists of nodes in ascending order,
// which is ascending order of images.
class FeatureSets {
 public:
  explicit FeatureSets(std::vector<std::int64_t> image_begin)
      : image_begin_(std::move(image_begin)),
        parent_(static_cast<std::size_t>(image_begin_.back())),
        next_(parent_.size(), -1),
        head_(parent_.size()) {
    std::iota(parent_.begin(), parent_.end(), std::int64_t{0});
    std::iota(head_.begin(), head_.end(), std::int64_t{0});
  }

  std::int64_t root(std::int64_t node) {
    while (parent_[at(node)] != node) {
      parent_[at(node)] = parent_[at(parent_[at(node)])];
      node = parent_[at(node)];
    }
    return node;
  }
  bool is_root(std::int64_t node) const { return parent_[at(node)] == node; }

  // Unites two sets unless the union would see an image twice.
  void unite(std::int64_t node_a, std::int64_t node_b) {
    const std::int64_t a = root(node_a), b = root(node_b);
    if (a == b || share_image(a, b)) return;
    const std::int64_t low = std::min(a, b), high = std::max(a, b);
    head_[at(low)] = merge_lists(head_[at(a)], head_[at(b)]);
    parent_[at(high)] = low;
  }

  std::int64_t first(std::int64_t root_node) const { return head_[at(root_node)]; }
  std::int64_t next(std::int64_t node) const { return next_[at(node)]; }
  int length(std::int64_t root_node) const {
    int length = 0;
    for (std::int64_t n = first(root_node); n >= 0; n = next(n)) ++length;
    return length;
  }
  std::size_t image_of(std::int64_t node) const {
    const auto above = std::upper_bound(image_begin_.begin(), image_begin_.end(), node);
    return static_cast<std::size_t>(above - image_begin_.begin()) - 1;
  }
  std::int64_t node(ImageIndex image, std::int32_t feature) const { return image_begin_[at(image.value)] + feature; }
  std::int64_t row(std::int64_t n) const { return n - image_begin_[image_of(n)]; }
  std::int64_t size() const { return static_cast<std::int64_t>(parent_.size()); }

 private:
  static std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

  bool share_image(std::int64_t a, std::int64_t b) const {
    std::int64_t i = head_[at(a)], j = head_[at(b)];
    while (i >= 0 && j >= 0) {
      const std::size_t image_i = image_of(i), image_j = image_of(j);
      if (image_i == image_j) return true;
      if (image_i < image_j) {
        i = next_[at(i)];
      } else {
        j = next_[at(j)];
      }
    }
    return false;
  }

  std::int64_t merge_lists(std::int64_t i, std::int64_t j) {
    const std::int64_t head = std::min(i, j);
    std::int64_t last = -1;
    while (i >= 0 || j >= 0) {
      std::int64_t& smaller = j < 0 || (i >= 0 && i < j) ? i : j;
      const std::int64_t taken = smaller;
      smaller = next_[at(taken)];
      if (last >= 0) next_[at(last)] = taken;
      last = taken;
    }
    return head;
  }

  std::vector<std::int64_t> image_begin_, parent_, next_, head_;
};

namespace {

// The lowest row with the same position: SIFT reports a keypoint once per dominant orientation, but it is one point.
std::vector<std::vector<std::int32_t>> rows_by_position(
    const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints) {
  std::vector<std::vector<std::int32_t>> result(keypoints.size());
  for (std::size_t image = 0; image < keypoints.size(); ++image) {
    const std::vector<Keypoint>& points = keypoints[ImageIndex(static_cast<std::int64_t>(image))];
    std::vector<std::int32_t> order(points.size());
    std::iota(order.begin(), order.end(), 0);
    const auto position = [&](std::int32_t i) {
      const Keypoint& k = points[static_cast<std::size_t>(i)];
      return std::pair(k.x, k.y);
    };
    std::sort(order.begin(), order.end(),
              [&](std::int32_t i, std::int32_t j) { return std::pair(position(i), i) < std::pair(position(j), j); });
    result[image].resize(points.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      const bool repeats = i > 0 && position(order[i]) == position(order[i - 1]);
      result[image][static_cast<std::size_t>(order[i])] =
          repeats ? result[image][static_cast<std::size_t>(order[i - 1])] : order[i];
    }
  }
  return result;
}

void check_pair(const VerifiedPair& pair, const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints) {
  const auto complain = [&](const std::string& what) {
    throw InputError("matches of images " + std::to_string(pair.a.value) + " and " + std::to_string(pair.b.value) +
                     ": " + what);
  };
  if (!keypoints.contains(pair.a) || !keypoints.contains(pair.b) || pair.a == pair.b) complain("no such image pair");
  if (pair.feature_a.size() != pair.feature_b.size()) complain("columns of different length");
  const auto outside = [](const std::vector<std::int32_t>& rows, std::size_t count) {
    return std::any_of(rows.begin(), rows.end(),
                       [&](std::int32_t r) { return r < 0 || static_cast<std::size_t>(r) >= count; });
  };
  if (outside(pair.feature_a, keypoints[pair.a].size()) || outside(pair.feature_b, keypoints[pair.b].size())) {
    complain("a feature does not exist");
  }
}

// Pairs with many inliers first: their links are the surest.
std::vector<std::size_t> order_of_pairs(const std::vector<VerifiedPair>& pairs) {
  std::vector<std::size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
    const VerifiedPair &p = pairs[i], &q = pairs[j];
    if (p.feature_a.size() != q.feature_a.size()) return p.feature_a.size() > q.feature_a.size();
    return std::pair(p.a, p.b) < std::pair(q.a, q.b);
  });
  return order;
}

}  // namespace

TrackBuilder::TrackBuilder(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints)
    : keypoints_(keypoints), canonical_(rows_by_position(keypoints)) {
  std::vector<std::int64_t> image_begin{0};
  for (const auto& points : keypoints)
    image_begin.push_back(image_begin.back() + static_cast<std::int64_t>(points.size()));
  sets_ = std::make_unique<FeatureSets>(std::move(image_begin));
}

TrackBuilder::~TrackBuilder() = default;

void TrackBuilder::add(const std::vector<VerifiedPair>& pairs) {
  for (const std::size_t i : order_of_pairs(pairs)) {
    const VerifiedPair& pair = pairs[i];
    check_pair(pair, keypoints_);
    const auto &rows_a = canonical_[static_cast<std::size_t>(pair.a.value)],
               &rows_b = canonical_[static_cast<std::size_t>(pair.b.value)];
    for (std::size_t m = 0; m < pair.feature_a.size(); ++m) {
      sets_->unite(sets_->node(pair.a, rows_a[static_cast<std::size_t>(pair.feature_a[m])]),
                   sets_->node(pair.b, rows_b[static_cast<std::size_t>(pair.feature_b[m])]));
    }
  }
}

IndexedVector<ImageIndex, std::int64_t> TrackBuilder::long_tracks() const {
  IndexedVector<ImageIndex, std::int64_t> count(keypoints_.size(), 0);
  for (std::int64_t root = 0; root < sets_->size(); ++root) {
    if (!sets_->is_root(root) || sets_->length(root) < 3) continue;
    for (std::int64_t n = sets_->first(root); n >= 0; n = sets_->next(n))
      ++count[ImageIndex(static_cast<std::int64_t>(sets_->image_of(n)))];
  }
  return count;
}

TrackSet TrackBuilder::tracks(const TrackOptions& options) const {
  if (options.min_length < 2) throw InputError("min_length of tracks must be at least 2");
  // A root is the lowest node of its set, so ascending roots are ordered by first image, then first feature.
  TrackSet tracks;
  tracks.begin.push_back(0);
  for (std::int64_t root = 0; root < sets_->size(); ++root) {
    if (!sets_->is_root(root) || sets_->length(root) < options.min_length) continue;
    for (std::int64_t n = sets_->first(root); n >= 0; n = sets_->next(n)) {
      const ImageIndex image(static_cast<std::int64_t>(sets_->image_of(n)));
      const std::int64_t row = sets_->row(n);
      const Keypoint& keypoint = keypoints_[image][static_cast<std::size_t>(row)];
      tracks.image.push_back(image);
      tracks.x.push_back(keypoint.x);
      tracks.y.push_back(keypoint.y);
      tracks.feature.push_back(static_cast<std::int32_t>(row));
    }
    tracks.id.push_back(TrackIndex(tracks.track_count()));
    tracks.begin.push_back(static_cast<std::int64_t>(tracks.image.size()));
  }
  return tracks;
}

TrackSet build_tracks(const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                      const std::vector<VerifiedPair>& pairs, const TrackOptions& options) {
  TrackBuilder builder(keypoints);
  builder.add(pairs);
  return builder.tracks(options);
}

}  // namespace megablock
