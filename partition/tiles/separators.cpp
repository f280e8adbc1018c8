#include "partition/tiles/separators.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace megablock {

namespace {

struct Link {
  std::int32_t left, right;  // frames in the left and the right half
};

// The links sorted by the tree node at which their two frames part: those of node n are links[begin[n]] to
// links[begin[n + 1] - 1].
struct LinksOfNodes {
  std::vector<std::size_t> begin;
  std::vector<Link> links;
};

// Sorts links by the node at which their ends part, the lowest common ancestor of their leaves.
class Parting {
 public:
  Parting(const std::vector<std::int32_t>& leaf_of_frame, const MergeTree& tree)
      : leaf_of_frame_(leaf_of_frame), tree_(tree), depth_(depths(tree)) {
    for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
      const TileIndex leaf = tree.nodes[n].tile;
      if (!leaf.valid()) continue;
      if (node_of_leaf_.size() <= static_cast<std::size_t>(leaf.value))
        node_of_leaf_.resize(static_cast<std::size_t>(leaf.value) + 1, -1);
      node_of_leaf_[static_cast<std::size_t>(leaf.value)] = static_cast<std::int64_t>(n);
    }
  }

  LinksOfNodes run(const FrameGraph& graph, const std::vector<std::uint8_t>& apart) const {
    LinksOfNodes result;
    result.begin.assign(tree_.nodes.size() + 1, 0);
    const auto visit = [&](const auto& take) {
      for (const FrameEdge& edge : graph.edges) {
        const auto a = static_cast<std::size_t>(edge.a.value), b = static_cast<std::size_t>(edge.b.value);
        if (leaf_of_frame_[a] < 0 || leaf_of_frame_[b] < 0 || leaf_of_frame_[a] == leaf_of_frame_[b]) continue;
        if (!apart.empty() && (apart[a] || apart[b])) continue;
        part(static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), take);
      }
    };
    // Two passes over the links: the first counts those of each node, the second fills them in.
    visit([&](std::int64_t node, Link) { ++result.begin[static_cast<std::size_t>(node) + 1]; });
    std::partial_sum(result.begin.begin(), result.begin.end(), result.begin.begin());
    result.links.resize(result.begin.back());
    std::vector<std::size_t> next = result.begin;
    visit([&](std::int64_t node, Link link) { result.links[next[static_cast<std::size_t>(node)]++] = link; });
    return result;
  }

  std::int32_t depth(std::size_t node) const { return depth_[node]; }

 private:
  template <typename Take>
  void part(std::int32_t a, std::int32_t b, const Take& take) const {
    const auto leaf = [&](std::int32_t frame) {
      return node_of_leaf_[static_cast<std::size_t>(leaf_of_frame_[static_cast<std::size_t>(frame)])];
    };
    const auto parent = [&](std::int64_t node) { return tree_.nodes[static_cast<std::size_t>(node)].parent; };
    const auto deep = [&](std::int64_t node) { return depth_[static_cast<std::size_t>(node)]; };
    // Climb from both leaves to the same depth, then together until the parents coincide.
    std::int64_t x = leaf(a), y = leaf(b);
    while (deep(x) > deep(y)) x = parent(x);
    while (deep(y) > deep(x)) y = parent(y);
    while (parent(x) != parent(y)) x = parent(x), y = parent(y);
    const std::int64_t node = parent(x);
    if (node < 0) return;  // in separate trees
    if (tree_.nodes[static_cast<std::size_t>(node)].left == x)
      take(node, Link{a, b});
    else
      take(node, Link{b, a});
  }

  const std::vector<std::int32_t>& leaf_of_frame_;
  const MergeTree& tree_;
  std::vector<std::int32_t> depth_;
  std::vector<std::int64_t> node_of_leaf_;
};

// The largest matching and the smallest vertex cover of the links of one node.
class VertexCover {
 public:
  // `number` is scratch space with -1 for every frame before and after the call.
  VertexCover(const std::vector<Link>& links, std::vector<std::int32_t>& number) {
    const auto list = [&](std::int32_t Link::*end, std::vector<std::int32_t>& frames) {
      for (const Link& link : links) frames.push_back(link.*end);
      std::sort(frames.begin(), frames.end());
      frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
      for (std::size_t i = 0; i < frames.size(); ++i)
        number[static_cast<std::size_t>(frames[i])] = static_cast<std::int32_t>(i);
    };
    list(&Link::left, left_);
    list(&Link::right, right_);
    // Links in compressed rows by the left frames, with numbers instead of frame indices.
    begin_.assign(left_.size() + 1, 0);
    for (const Link& link : links) ++begin_[row(link.left, number) + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    neighbour_.resize(links.size());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for (const Link& link : links)
      neighbour_[next[row(link.left, number)]++] = static_cast<std::int32_t>(row(link.right, number));
    for (const std::vector<std::int32_t>* frames : {&left_, &right_})
      for (const std::int32_t frame : *frames) number[static_cast<std::size_t>(frame)] = -1;
    partner_of_left_.assign(left_.size(), -1);
    partner_of_right_.assign(right_.size(), -1);
  }

  std::vector<std::int32_t> frames() {
    // Hopcroft and Karp: each phase augments along a maximal set of shortest paths, so there are few phases.
    while (layer()) {
      next_.assign(begin_.begin(), begin_.end() - 1);
      for (std::size_t i = 0; i < left_.size(); ++i)
        if (partner_of_left_[i] < 0) augment(static_cast<std::int32_t>(i));
    }
    // After the last layering, layer_ tells which frames on the left alternating paths reach from unmatched frames. By
    // the theorem of Koenig the cover consists of the left frames that are not reached and the right frames that are.
    std::vector<std::int32_t> cover;
    std::vector<std::uint8_t> reached(right_.size(), 0);
    for (std::size_t i = 0; i < left_.size(); ++i) {
      if (layer_[i] == kUnreached) {
        cover.push_back(left_[i]);
        continue;
      }
      for (std::size_t e = begin_[i]; e < begin_[i + 1]; ++e) reached[static_cast<std::size_t>(neighbour_[e])] = 1;
    }
    for (std::size_t j = 0; j < right_.size(); ++j)
      if (reached[j]) cover.push_back(right_[j]);
    return cover;
  }

 private:
  static constexpr std::int32_t kUnreached = std::numeric_limits<std::int32_t>::max();
  static std::size_t row(std::int32_t frame, const std::vector<std::int32_t>& number) {
    return static_cast<std::size_t>(number[static_cast<std::size_t>(frame)]);
  }

  // Breadth-first search: layers of the left frames by the length of alternating paths. Returns true when a path ends
  // at an unmatched frame on the right.
  bool layer() {
    layer_.assign(left_.size(), kUnreached);
    std::vector<std::int32_t> queue;
    for (std::size_t i = 0; i < left_.size(); ++i)
      if (partner_of_left_[i] < 0) {
        layer_[i] = 0;
        queue.push_back(static_cast<std::int32_t>(i));
      }
    bool found = false;
    for (std::size_t head = 0; head < queue.size(); ++head) {
      const auto i = static_cast<std::size_t>(queue[head]);
      for (std::size_t e = begin_[i]; e < begin_[i + 1]; ++e) {
        const std::int32_t partner = partner_of_right_[static_cast<std::size_t>(neighbour_[e])];
        if (partner < 0) {
          found = true;
        } else if (layer_[static_cast<std::size_t>(partner)] == kUnreached) {
          layer_[static_cast<std::size_t>(partner)] = layer_[i] + 1;
          queue.push_back(partner);
        }
      }
    }
    return found;
  }

  // Depth-first search along the layers for an augmenting path. It has its own stack, because paths grow with the
  // graph.
  void augment(std::int32_t start) {
    std::vector<std::int32_t> path = {start};
    while (!path.empty()) {
      const auto i = static_cast<std::size_t>(path.back());
      if (next_[i] == begin_[i + 1]) {  // a dead end
        path.pop_back();
        if (!path.empty()) ++next_[static_cast<std::size_t>(path.back())];
        continue;
      }
      const std::int32_t partner = partner_of_right_[static_cast<std::size_t>(neighbour_[next_[i]])];
      if (partner < 0) {
        for (const std::int32_t left : path) {
          const std::int32_t right = neighbour_[next_[static_cast<std::size_t>(left)]++];
          partner_of_left_[static_cast<std::size_t>(left)] = right;
          partner_of_right_[static_cast<std::size_t>(right)] = left;
        }
        return;
      }
      if (layer_[static_cast<std::size_t>(partner)] == layer_[i] + 1)
        path.push_back(partner);
      else
        ++next_[i];
    }
  }

  std::vector<std::int32_t> left_, right_;  // frames, ascending
  std::vector<std::size_t> begin_;          // [left + 1] into neighbour_
  std::vector<std::int32_t> neighbour_;     // rows of right_
  std::vector<std::int32_t> partner_of_left_, partner_of_right_, layer_;
  std::vector<std::size_t> next_;  // [left] the next link to try
};

}  // namespace

std::vector<std::int32_t> depths(const MergeTree& tree) {
  std::vector<std::int32_t> depth(tree.nodes.size(), 0);
  for (std::size_t n = tree.nodes.size(); n-- > 0;)  // parents come after their children
    if (const std::int64_t parent = tree.nodes[n].parent; parent >= 0)
      depth[n] = depth[static_cast<std::size_t>(parent)] + 1;
  return depth;
}

std::vector<std::int32_t> separator_depths(const FrameGraph& graph, const std::vector<std::int32_t>& leaf_of_frame,
                                           const MergeTree& tree, const std::vector<std::uint8_t>& apart) {
  const Parting parting(leaf_of_frame, tree);
  const LinksOfNodes parted = parting.run(graph, apart);
  std::vector<std::int32_t> depth(leaf_of_frame.size(), -1), number(leaf_of_frame.size(), -1);
  // From the root downwards: links that a separator further up already cuts are left out below.
  std::vector<Link> open;
  for (std::size_t node = tree.nodes.size(); node-- > 0;) {
    open.clear();
    for (std::size_t i = parted.begin[node]; i < parted.begin[node + 1]; ++i) {
      const Link& link = parted.links[i];
      if (depth[static_cast<std::size_t>(link.left)] < 0 && depth[static_cast<std::size_t>(link.right)] < 0)
        open.push_back(link);
    }
    if (open.empty()) continue;
    for (const std::int32_t frame : VertexCover(open, number).frames())
      depth[static_cast<std::size_t>(frame)] = parting.depth(node);
  }
  return depth;
}

}  // namespace megablock
