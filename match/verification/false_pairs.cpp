#include "match/verification/false_pairs.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

constexpr std::int64_t kFewestExpected = 30;  // features of a pair whose q is known
constexpr int kOtherPairs = 2;                // in which a good feature is matched
constexpr int kSurrounding = 3;               // matches about a feature that the other image should show
constexpr double kAmong = 0.04;               // about it, share of the extent of the image
constexpr double kOpen = 20 * kDegree, kOpenByPair = 1 * kDegree;  // a cycle does not close
constexpr double kProvenSigmas = 4, kProvenShare = 0.75;
constexpr std::int64_t kFewestFalse = 5;
constexpr double kFewestShare = 0.05;

// How many matches of a pair lie about a place of one image. Cells of two thirds of the reach: the three by three cells
// about a place reach as far as kAmong in the mean.
class MatchDensity {
 public:
  MatchDensity(const std::vector<Keypoint>& keypoints, const std::vector<std::int32_t>& rows, double extent)
      : cell_(std::max(1.0, kAmong * extent * 2 / 3)) {
    for (const std::int32_t r : rows) ++count_[key(keypoints[static_cast<std::size_t>(r)], 0, 0)];
  }
  int about(const Keypoint& at) const {
    int sum = 0;
    for (const int dx : {-1, 0, 1})
      for (const int dy : {-1, 0, 1})
        if (const auto found = count_.find(key(at, dx, dy)); found != count_.end()) sum += found->second;
    return sum;
  }

 private:
  std::int64_t key(const Keypoint& at, int dx, int dy) const {
    const auto x = static_cast<std::int64_t>(at.x / cell_) + dx, y = static_cast<std::int64_t>(at.y / cell_) + dy;
    return (y + 1) * (std::int64_t{1} << 32) + x + 1;
  }
  double cell_;
  std::unordered_map<std::int64_t, int> count_;
};

Eigen::Quaterniond rotation_of(const PairOrientation& orientation) {
  const auto& [w, x, y, z] = orientation.rotation_wxyz;
  return Eigen::Quaterniond(w, x, y, z).normalized();
}

bool known(const PairEvidence& p) { return p.expected >= kFewestExpected; }
double found_share(const PairEvidence& p) { return static_cast<double>(p.found) / static_cast<double>(p.expected); }

// Whether the share of `p` is lower than that of `q` by more than chance, and by much.
bool clearly_lower(const PairEvidence& p, const PairEvidence& q) {
  const auto np = static_cast<double>(p.expected), nq = static_cast<double>(q.expected);
  const double all = static_cast<double>(p.found + q.found) / (np + nq);
  const double sigma = std::sqrt(all * (1 - all) * (1 / np + 1 / nq));
  return found_share(q) - found_share(p) > kProvenSigmas * sigma && found_share(p) < kProvenShare * found_share(q);
}

// The share less two sigmas, with one half added to hits and misses.
double sure_share(const PairEvidence& p) {
  const double n = static_cast<double>(p.expected) + 1, q = (static_cast<double>(p.found) + 0.5) / n;
  return q - 2 * std::sqrt(q * (1 - q) / n);
}

// The spanning trees of the pairs with the largest shares: an image's way to its root.
class ShareTree {
 public:
  explicit ShareTree(const std::vector<PairEvidence>& pairs) : in_tree(pairs.size(), 0), pairs_(pairs) {
    std::int64_t images = 0;
    for (const PairEvidence& p : pairs) images = std::max({images, p.a.value + 1, p.b.value + 1});
    nodes_.resize(static_cast<std::size_t>(images));
    const PairsOfImages links = choose_pairs();
    std::vector<std::uint8_t> reached(nodes_.size(), 0);
    for (std::size_t root = 0; root < nodes_.size(); ++root)
      if (!reached[root]) grow_from(root, links, reached);
  }

  // How the tree relates the images of a pair: its error, and the pairs of the tree between them.
  struct Cycle {
    double error_rad = 0;
    int length = 0;          // pairs of the tree
    std::size_t lowest = 0;  // of them, the one with the smallest sure share
  };
  Cycle cycle(const PairEvidence& pair) const {
    auto a = static_cast<std::size_t>(pair.a.value), b = static_cast<std::size_t>(pair.b.value);
    Cycle cycle;
    cycle.error_rad = rotation_angle(nodes_[b].rotation, pair.rotation * nodes_[a].rotation);
    if (pair.twin)
      cycle.error_rad = std::min(cycle.error_rad, rotation_angle(nodes_[b].rotation, *pair.twin * nodes_[a].rotation));
    double lowest = 2;
    while (a != b) {
      std::size_t& deeper = nodes_[a].depth >= nodes_[b].depth ? a : b;
      const std::size_t e = nodes_[deeper].pair;
      if (const double share = sure_share(pairs_[e]); share < lowest) {
        lowest = share;
        cycle.lowest = e;
      }
      ++cycle.length;
      deeper = nodes_[deeper].parent;
    }
    return cycle;
  }

  std::vector<std::uint8_t> in_tree;  // [pairs]

 private:
  struct Node {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // of the root -> of this image
    std::size_t parent = 0, pair = 0;
    int depth = 0;
  };
  using PairsOfImages = std::vector<std::vector<std::size_t>>;  // [images] rows of pairs

  // The pairs with the largest sure shares that close no cycle.
  PairsOfImages choose_pairs() {
    std::vector<std::size_t> order(pairs_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t e, std::size_t f) { return sure_share(pairs_[e]) > sure_share(pairs_[f]); });
    DisjointSets sets(std::ssize(nodes_));
    PairsOfImages links(nodes_.size());
    for (const std::size_t e : order) {
      if (!sets.unite(pairs_[e].a.value, pairs_[e].b.value)) continue;
      in_tree[e] = 1;
      for (const ImageIndex i : {pairs_[e].a, pairs_[e].b}) links[static_cast<std::size_t>(i.value)].push_back(e);
    }
    return links;
  }

  // Gives the images that the tree joins to this root their ways to it.
  void grow_from(std::size_t root, const PairsOfImages& links, std::vector<std::uint8_t>& reached) {
    reached[root] = 1;
    std::vector<std::size_t> queue{root};
    for (std::size_t next = 0; next < queue.size(); ++next) {
      const std::size_t from = queue[next];
      for (const std::size_t e : links[from]) {
        const bool forward = static_cast<std::size_t>(pairs_[e].a.value) == from;
        const auto to = static_cast<std::size_t>((forward ? pairs_[e].b : pairs_[e].a).value);
        if (reached[to]) continue;
        reached[to] = 1;
        const Eigen::Quaterniond turn = forward ? pairs_[e].rotation : pairs_[e].rotation.conjugate();
        nodes_[to] = {(turn * nodes_[from].rotation).normalized(), from, e, nodes_[from].depth + 1};
        queue.push_back(to);
      }
    }
  }

  const std::vector<PairEvidence>& pairs_;
  std::vector<Node> nodes_;  // [images]
};

}  // namespace

std::vector<PairEvidence> evidence_of_pairs(const std::vector<VerifiedPair>& pairs,
                                            const IndexedVector<ImageIndex, std::vector<Keypoint>>& keypoints,
                                            int threads) {
  IndexedVector<ImageIndex, std::vector<std::int32_t>> times;  // in how many pairs each feature is matched
  IndexedVector<ImageIndex, double> extent;
  times.resize(keypoints.size());
  extent.resize(keypoints.size());
  for (ImageIndex i(0); keypoints.contains(i); ++i.value) {
    times[i].assign(keypoints[i].size(), 0);
    for (const Keypoint& k : keypoints[i]) extent[i] = std::max(extent[i], static_cast<double>(std::max(k.x, k.y)));
  }
  for (const VerifiedPair& pair : pairs) {
    for (const std::int32_t r : pair.feature_a) ++times[pair.a][static_cast<std::size_t>(r)];
    for (const std::int32_t r : pair.feature_b) ++times[pair.b][static_cast<std::size_t>(r)];
  }
  std::vector<PairEvidence> result(pairs.size());
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const VerifiedPair& pair = pairs[p];
    result[p] = {pair.a, pair.b, rotation_of(pair), 0, 0};
    if (pair.twin) result[p].twin = rotation_of(*pair.twin);
    for (const auto& [image, rows] : {std::pair(pair.a, &pair.feature_a), std::pair(pair.b, &pair.feature_b)}) {
      const std::vector<Keypoint>& of = keypoints[image];
      const MatchDensity density(of, *rows, extent[image]);
      std::vector<std::uint8_t> matched(of.size(), 0);
      for (const std::int32_t r : *rows) matched[static_cast<std::size_t>(r)] = 1;
      for (std::size_t k = 0; k < of.size(); ++k) {
        if (times[image][k] - matched[k] < kOtherPairs || density.about(of[k]) - matched[k] < kSurrounding) continue;
        ++result[p].expected;
        result[p].found += matched[k];
      }
    }
  }
  return result;
}

std::int64_t FalsePairs::count() const { return std::count(is_false.begin(), is_false.end(), 1); }

FalsePairs find_false_pairs(const std::vector<PairEvidence>& pairs) {
  FalsePairs result;
  result.is_false.assign(pairs.size(), 0);
  const ShareTree tree(pairs);
  std::vector<std::uint8_t> found(pairs.size(), 0);
  for (std::size_t e = 0; e < pairs.size(); ++e) {
    if (tree.in_tree[e]) continue;
    const ShareTree::Cycle cycle = tree.cycle(pairs[e]);
    if (cycle.error_rad <= kOpen + kOpenByPair * cycle.length) continue;
    ++result.open;
    if (known(pairs[e]) && !clearly_lower(pairs[e], pairs[cycle.lowest])) continue;
    found[e] = 1;
    result.proven += known(pairs[e]);
  }
  if (result.proven >= kFewestFalse &&
      static_cast<double>(result.proven) >= kFewestShare * static_cast<double>(pairs.size()))
    result.is_false = std::move(found);
  return result;
}

}  // namespace megablock
