// Bisects the graph recursively with METIS (G. Karypis and V. Kumar, "A fast and high quality multilevel scheme for
// partitioning irregular graphs", SIAM J. Sci. Comput. 20(1), 1998). Every level divides a set of nodes in two with
// METIS_PartGraphRecursive and a fixed seed. The tree of these divisions is the elimination tree of merge/.
//
// A half may consist of several fragments, whereas a tile should be in one piece, so that it can be adjusted on its
// own. Then METIS_PartGraphKway is tried, which can keep both halves in one piece, but not always with the wanted
// sizes. Where it fails, a fragment is moved to the other half if that cuts fewer links, as long as each half keeps a
// quarter of the nodes.
#include <metis.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "io/base/error.h"
#include "partition/tiles/tiles.h"

namespace megablock {

namespace {

constexpr idx_t kSeed = 20260;
constexpr idx_t kImbalance = 20;          // per mille above the ideal half, at each level
constexpr double kWorstImbalance = 0.05;  // share of all nodes, for halves in one piece
// Leaves are planned 5 % below the limit. A later division gets one leaf more if its set came out so large that the
// imbalance of METIS could take a leaf above the limit.
constexpr double kPlanMargin = 1.05, kSplitMargin = 1.02;
constexpr std::int64_t kWeightLimit = 1 << 30;  // METIS adds edge weights in 32 bits

// An undirected graph in compressed rows; all nodes have the weight 1.
struct Adjacency {
  std::vector<idx_t> begin, neighbour, weight;
  idx_t size() const { return static_cast<idx_t>(begin.size()) - 1; }
};

void check_size(const FrameGraph& graph) {
  constexpr std::int64_t limit = std::numeric_limits<idx_t>::max();
  if (graph.frame_count >= limit || 2 * static_cast<std::int64_t>(graph.edges.size()) >= limit)
    throw ComputeError("frame graph of " + std::to_string(graph.frame_count) + " frames and " +
                       std::to_string(graph.edges.size()) +
                       " links exceeds the 32-bit indices of METIS; split the block into several jobs");
}

Adjacency adjacency(const FrameGraph& graph) {
  std::int64_t total = 0;
  Adjacency result;
  result.begin.assign(static_cast<std::size_t>(graph.frame_count) + 1, 0);
  for (const FrameEdge& edge : graph.edges) {
    if (edge.a.value < 0 || edge.b.value >= graph.frame_count || edge.a >= edge.b)
      throw ComputeError("frame graph: a link must join two frames of the graph, the lower index first");
    total += 2 * edge.weight;
    ++result.begin[static_cast<std::size_t>(edge.a.value) + 1];
    ++result.begin[static_cast<std::size_t>(edge.b.value) + 1];
  }
  std::partial_sum(result.begin.begin(), result.begin.end(), result.begin.begin());
  // Weights are scaled down where their sum would overflow METIS's 32 bits.
  const std::int64_t divisor = total / kWeightLimit + 1;
  std::vector<idx_t> next(result.begin.begin(), result.begin.end() - 1);
  result.neighbour.resize(2 * graph.edges.size());
  result.weight.resize(2 * graph.edges.size());
  const auto add = [&](FrameIndex from, FrameIndex to, std::int64_t weight) {
    const auto slot = static_cast<std::size_t>(next[static_cast<std::size_t>(from.value)]++);
    result.neighbour[slot] = static_cast<idx_t>(to.value);
    result.weight[slot] = static_cast<idx_t>(std::max<std::int64_t>(1, weight / divisor));
  };
  for (const FrameEdge& edge : graph.edges) {
    add(edge.a, edge.b, edge.weight);
    add(edge.b, edge.a, edge.weight);
  }
  return result;
}

// The subgraph of the nodes with side[v] == which, renumbered in their order.
Adjacency subgraph(const Adjacency& graph, const std::vector<idx_t>& side, idx_t which) {
  std::vector<idx_t> position(side.size(), -1);
  idx_t count = 0;
  for (std::size_t v = 0; v < side.size(); ++v)
    if (side[v] == which) position[v] = count++;
  Adjacency part;
  part.begin.reserve(static_cast<std::size_t>(count) + 1);
  part.begin.push_back(0);
  idx_t links = 0;  // including those to the other half
  for (std::size_t v = 0; v < side.size(); ++v)
    if (side[v] == which) links += graph.begin[v + 1] - graph.begin[v];
  part.neighbour.reserve(static_cast<std::size_t>(links));
  part.weight.reserve(static_cast<std::size_t>(links));
  for (std::size_t v = 0; v < side.size(); ++v) {
    if (side[v] != which) continue;
    for (idx_t e = graph.begin[v]; e < graph.begin[v + 1]; ++e) {
      const idx_t to = position[static_cast<std::size_t>(graph.neighbour[static_cast<std::size_t>(e)])];
      if (to < 0) continue;
      part.neighbour.push_back(to);
      part.weight.push_back(graph.weight[static_cast<std::size_t>(e)]);
    }
    part.begin.push_back(static_cast<idx_t>(part.neighbour.size()));
  }
  return part;
}

// Connected pieces of the nodes of each side.
struct Fragments {
  std::vector<idx_t> of_node, size, side;
  std::vector<std::int64_t> outward;  // weight of the links to the other side
};

Fragments fragments_of(const Adjacency& graph, const std::vector<idx_t>& side) {
  Fragments result;
  result.of_node.assign(side.size(), -1);
  std::vector<idx_t> stack;
  for (std::size_t start = 0; start < side.size(); ++start) {
    if (result.of_node[start] >= 0) continue;
    const auto fragment = static_cast<idx_t>(result.size.size());
    result.size.push_back(0);
    result.side.push_back(side[start]);
    result.outward.push_back(0);
    // Depth-first search with its own stack: recursion would be as deep as a street is long.
    stack.assign(1, static_cast<idx_t>(start));
    result.of_node[start] = fragment;
    while (!stack.empty()) {
      const auto v = static_cast<std::size_t>(stack.back());
      stack.pop_back();
      ++result.size.back();
      for (idx_t e = graph.begin[v]; e < graph.begin[v + 1]; ++e) {
        const auto to = static_cast<std::size_t>(graph.neighbour[static_cast<std::size_t>(e)]);
        if (side[to] != side[v]) {
          result.outward.back() += graph.weight[static_cast<std::size_t>(e)];
        } else if (result.of_node[to] < 0) {
          result.of_node[to] = fragment;
          stack.push_back(static_cast<idx_t>(to));
        }
      }
    }
  }
  return result;
}

// Moves fragments other than the largest of each side to the other side, where the sizes allow it.
void join_fragments(const Adjacency& graph, std::vector<idx_t>& side) {
  const Fragments fragments = fragments_of(graph, side);
  if (fragments.size.size() <= 2) return;
  // The largest fragment of each side stays; another one moves if its side keeps a quarter of all nodes without it.
  std::array<idx_t, 2> largest = {-1, -1}, count = {0, 0};
  for (std::size_t i = 0; i < fragments.size.size(); ++i) {
    const auto s = static_cast<std::size_t>(fragments.side[i]);
    count[s] += fragments.size[i];
    if (largest[s] < 0 || fragments.size[i] > fragments.size[static_cast<std::size_t>(largest[s])])
      largest[s] = static_cast<idx_t>(i);
  }
  std::vector<std::uint8_t> move(fragments.size.size(), 0);
  for (std::size_t i = 0; i < fragments.size.size(); ++i) {
    const auto s = static_cast<std::size_t>(fragments.side[i]);
    if (largest[s] == static_cast<idx_t>(i) || fragments.outward[i] == 0) continue;
    if (4 * (count[s] - fragments.size[i]) < graph.size()) continue;
    count[s] -= fragments.size[i];
    count[1 - s] += fragments.size[i];
    move[i] = 1;
  }
  for (std::size_t v = 0; v < side.size(); ++v)
    if (move[static_cast<std::size_t>(fragments.of_node[v])]) side[v] = 1 - side[v];
}

// Side (0 or 1) of every node. `partition` is METIS_PartGraphRecursive or METIS_PartGraphKway.
template <typename Partition>
std::vector<idx_t> metis_split(Adjacency& graph, double left_share, const Partition& partition, idx_t contiguous) {
  idx_t nodes = graph.size(), constraints = 1, parts = 2, cut = 0;
  std::vector<idx_t> side(static_cast<std::size_t>(nodes), 0);
  std::array<idx_t, METIS_NOPTIONS> options;
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_SEED] = kSeed;
  options[METIS_OPTION_NITER] = 10;
  options[METIS_OPTION_NCUTS] = 2;
  options[METIS_OPTION_UFACTOR] = kImbalance;
  options[METIS_OPTION_CONTIG] = contiguous;
  std::array<real_t, 2> shares = {static_cast<real_t>(left_share), static_cast<real_t>(1 - left_share)};
  const int status = partition(&nodes, &constraints, graph.begin.data(), graph.neighbour.data(), nullptr, nullptr,
                               graph.weight.data(), &parts, shares.data(), nullptr, options.data(), &cut, side.data());
  if (status != METIS_OK) throw ComputeError("METIS could not bisect a graph of " + std::to_string(nodes) + " frames");
  return side;
}

// Divides a graph so that side 0 gets about `left_share` of the nodes.
std::vector<idx_t> split(Adjacency& graph, double left_share) {
  const idx_t nodes = graph.size();
  std::vector<idx_t> side(static_cast<std::size_t>(nodes), 0);
  if (!graph.neighbour.empty() && nodes > 2) {
    side = metis_split(graph, left_share, METIS_PartGraphRecursive, 0);
    // METIS keeps the halves in one piece only if the graph itself is in one piece.
    const auto pieces = [&](const std::vector<idx_t>& of) { return fragments_of(graph, of).size.size(); };
    if (pieces(side) > 2 && pieces(std::vector<idx_t>(side.size(), 0)) == 1) {
      std::vector<idx_t> whole = metis_split(graph, left_share, METIS_PartGraphKway, 1);
      const auto first = static_cast<double>(std::count(whole.begin(), whole.end(), 0));
      if (pieces(whole) == 2 && std::abs(first - left_share * nodes) <= kWorstImbalance * nodes)
        side = std::move(whole);
    }
    join_fragments(graph, side);
  }
  const auto left = std::count(side.begin(), side.end(), 0);
  if (left == 0 || left == nodes) {  // no links, or too few nodes: divide by number
    const auto wanted = std::clamp<std::int64_t>(std::llround(left_share * nodes), 1, nodes - 1);
    for (std::size_t v = 0; v < side.size(); ++v) side[v] = static_cast<std::int64_t>(v) < wanted ? 0 : 1;
  }
  // The half with the lowest node comes first, so that METIS's naming of the halves does not matter.
  if (side.front() != 0)
    for (idx_t& s : side) s = 1 - s;
  return side;
}

class Bisector {
 public:
  Bisector(std::int64_t node_count, std::int64_t max_leaf) : max_leaf_(max_leaf) {
    result_.leaf_of_node.assign(static_cast<std::size_t>(node_count), -1);
  }
  // Appends the tree over `nodes` in postorder and returns the number of its root. `leaves` is the number of leaves
  // planned.
  std::int64_t run(Adjacency graph, const std::vector<std::int32_t>& nodes, std::int64_t leaves) {
    const auto count = static_cast<std::int64_t>(nodes.size());
    if (count > max_leaf_) {
      const double margin = nodes.size() == result_.leaf_of_node.size() ? kPlanMargin : kSplitMargin;
      leaves = std::max<std::int64_t>(leaves, static_cast<std::int64_t>(std::ceil(margin * static_cast<double>(count) /
                                                                                  static_cast<double>(max_leaf_))));
    }
    leaves = std::min(leaves, count);
    if (leaves <= 1) return add_leaf(nodes);
    const std::int64_t left_leaves = (leaves + 1) / 2;
    const double share = static_cast<double>(left_leaves) / static_cast<double>(leaves);
    const std::vector<idx_t> side = split(graph, share);
    std::array<Adjacency, 2> parts = {subgraph(graph, side, 0), subgraph(graph, side, 1)};
    std::array<std::vector<std::int32_t>, 2> members;
    for (std::size_t v = 0; v < side.size(); ++v) members[static_cast<std::size_t>(side[v])].push_back(nodes[v]);
    graph = Adjacency();
    // The leaves are shared out by the actual sizes, so that deviations of one level do not add to those of the next.
    const double shared =
        static_cast<double>(leaves * static_cast<std::int64_t>(members[0].size())) / static_cast<double>(count);
    const std::int64_t first = std::clamp<std::int64_t>(std::llround(shared), 1, leaves - 1);
    const std::int64_t left = run(std::move(parts[0]), members[0], first);
    const std::int64_t right = run(std::move(parts[1]), members[1], leaves - first);
    return join(result_.tree, left, right);
  }
  BisectionTree take() { return std::move(result_); }

 private:
  std::int64_t add_leaf(const std::vector<std::int32_t>& nodes) {
    for (std::int32_t v : nodes) result_.leaf_of_node[static_cast<std::size_t>(v)] = leaves_;
    MergeTree::Node node;
    node.tile = TileIndex(leaves_++);
    result_.tree.nodes.push_back(node);
    return static_cast<std::int64_t>(result_.tree.nodes.size()) - 1;
  }

  std::int64_t max_leaf_;
  std::int32_t leaves_ = 0;
  BisectionTree result_;
};

}  // namespace

std::int64_t join(MergeTree& tree, std::int64_t left, std::int64_t right) {
  const auto at = [&](std::int64_t i) -> MergeTree::Node& { return tree.nodes[static_cast<std::size_t>(i)]; };
  MergeTree::Node node;
  node.left = left;
  node.right = right;
  node.level = 1 + std::max(at(left).level, at(right).level);
  const auto number = static_cast<std::int64_t>(tree.nodes.size());
  at(left).parent = at(right).parent = number;
  tree.nodes.push_back(node);
  return number;
}

BisectionTree bisect(const FrameGraph& graph, std::int64_t max_leaf, std::int64_t min_leaves) {
  if (max_leaf < 1) throw InputError("bisection: max_leaf must be at least 1 frame");
  check_size(graph);
  Bisector bisector(graph.frame_count, max_leaf);
  if (graph.frame_count > 0) {
    std::vector<std::int32_t> nodes(static_cast<std::size_t>(graph.frame_count));
    Adjacency whole = adjacency(graph);
    std::iota(nodes.begin(), nodes.end(), 0);
    bisector.run(std::move(whole), nodes, min_leaves);
  }
  return bisector.take();
}

}  // namespace megablock
