#include "partition/tiles/tiles.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "io/base/disjoint_sets.h"
#include "io/base/error.h"
#include "partition/tiles/separators.h"

namespace megablock {

namespace {

using Frames = std::vector<FrameIndex>;  // ascending

// A connected set of frames with its bisection tree; leaf_of_node is by position in `frames`.
struct Component {
  Frames frames;
  BisectionTree cut;
};

// The links among `frames`, renumbered by position. `position` is scratch space, -1 before and after the call.
FrameGraph graph_of(const FrameGraph& graph, const Frames& frames, std::vector<std::int64_t>& position) {
  for (std::size_t i = 0; i < frames.size(); ++i)
    position[static_cast<std::size_t>(frames[i].value)] = static_cast<std::int64_t>(i);
  FrameGraph part;
  part.frame_count = static_cast<std::int64_t>(frames.size());
  for (const FrameEdge& edge : graph.edges) {
    const std::int64_t a = position[static_cast<std::size_t>(edge.a.value)];
    const std::int64_t b = position[static_cast<std::size_t>(edge.b.value)];
    if (a >= 0 && b >= 0) part.edges.push_back({FrameIndex(a), FrameIndex(b), edge.weight});
  }
  for (FrameIndex frame : frames) position[static_cast<std::size_t>(frame.value)] = -1;
  return part;
}

// The sets with more than one frame, the largest first; of equal size the one with the lowest frame.
std::vector<Frames> sets_of(DisjointSets& sets, std::int64_t count) {
  std::map<std::int64_t, Frames> by_representative;
  for (std::int64_t f = 0; f < count; ++f) by_representative[sets.find(f)].push_back(FrameIndex(f));
  std::vector<Frames> result;
  for (auto& [representative, frames] : by_representative)
    if (frames.size() > 1) result.push_back(std::move(frames));
  std::stable_sort(result.begin(), result.end(), [](const Frames& a, const Frames& b) { return a.size() > b.size(); });
  return result;
}

// The sets of frames that at least `tracks` tracks hold together. Links between sets found so far are added up, until
// no two sets share enough tracks.
std::vector<Frames> linked_sets(const FrameGraph& graph, std::int64_t tracks) {
  DisjointSets sets(graph.frame_count);
  for (bool changed = true; changed;) {
    changed = false;
    std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> total;
    for (const FrameEdge& edge : graph.edges) {
      const std::int64_t a = sets.find(edge.a.value), b = sets.find(edge.b.value);
      if (a == b) continue;
      if (edge.weight >= tracks) {
        sets.unite(a, b);
        changed = true;
      } else {
        total[std::minmax(a, b)] += edge.weight;
      }
    }
    if (changed) continue;
    for (const auto& [pair, weight] : total)
      if (weight >= tracks && sets.unite(pair.first, pair.second)) changed = true;
  }
  return sets_of(sets, graph.frame_count);
}

// Cuts the frames of a graph into components and these into tiles.
class TileMaker {
 public:
  TileMaker(const FrameGraph& graph, const TileOptions& options)
      : graph_(graph), options_(options), position_(static_cast<std::size_t>(graph.frame_count), -1) {}

  std::vector<Component> components() {
    std::vector<Frames> work = linked_sets(graph_, options_.weak_link_tracks);
    std::int64_t linked = 0;
    for (const Frames& frames : work) linked += static_cast<std::int64_t>(frames.size());
    std::vector<Component> result;
    for (std::size_t i = 0; i < work.size(); ++i) {  // `work` grows while components fall apart
      Frames frames = std::move(work[i]);
      // Bisect, drop the weak links between the leaves, and look whether the component is still connected. If not, its
      // pieces are bisected in their turn.
      const bool whole = static_cast<std::int64_t>(frames.size()) == graph_.frame_count;
      const FrameGraph links = whole ? FrameGraph() : part_of(frames);
      const FrameGraph& part = whole ? graph_ : links;  // without a copy
      BisectionTree cut = bisect(part, options_.tile_max_frames, least_tiles(frames.size(), linked));
      std::vector<Frames> pieces = pieces_without_weak_links(part, cut, frames);
      if (pieces.size() == 1 && pieces.front().size() == frames.size())
        result.push_back({std::move(frames), std::move(cut)});
      else
        std::move(pieces.begin(), pieces.end(), std::back_inserter(work));
    }
    std::sort(result.begin(), result.end(), [](const Component& a, const Component& b) {
      if (a.frames.size() != b.frames.size()) return a.frames.size() > b.frames.size();
      return a.frames.front() < b.frames.front();
    });
    return result;
  }

 private:
  // The part of min_tiles that falls to a component of this size.
  std::int64_t least_tiles(std::size_t frames, std::int64_t linked) const {
    if (linked < options_.min_tiles_from) return 1;
    const auto count = static_cast<std::int64_t>(frames);
    return (options_.min_tiles * count + linked - 1) / linked;
  }
  // The links among `frames`.
  FrameGraph part_of(const Frames& frames) {
    if (static_cast<std::int64_t>(frames.size()) > kScanLimit) return graph_of(graph_, frames, position_);
    return small_part_of(frames);
  }
  // For a few frames of a large graph: their links by binary search instead of a scan of all links.
  FrameGraph small_part_of(const Frames& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i)
      position_[static_cast<std::size_t>(frames[i].value)] = static_cast<std::int64_t>(i);
    FrameGraph part;
    part.frame_count = static_cast<std::int64_t>(frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      auto edge = std::lower_bound(graph_.edges.begin(), graph_.edges.end(), FrameEdge{frames[i], FrameIndex(), 0});
      for (; edge != graph_.edges.end() && edge->a == frames[i]; ++edge) {
        const std::int64_t b = position_[static_cast<std::size_t>(edge->b.value)];
        if (b >= 0) part.edges.push_back({FrameIndex(static_cast<std::int64_t>(i)), FrameIndex(b), edge->weight});
      }
    }
    for (FrameIndex frame : frames) position_[static_cast<std::size_t>(frame.value)] = -1;
    return part;
  }
  // The connected sets that remain when weak links between leaves are dropped.
  std::vector<Frames> pieces_without_weak_links(const FrameGraph& part, const BisectionTree& cut,
                                                const Frames& frames) const {
    const auto leaf = [&](FrameIndex f) { return cut.leaf_of_node[static_cast<std::size_t>(f.value)]; };
    DisjointSets sets(part.frame_count);
    for (const FrameEdge& edge : part.edges)
      if (edge.weight >= options_.weak_link_tracks || leaf(edge.a) == leaf(edge.b))
        sets.unite(edge.a.value, edge.b.value);
    std::vector<Frames> pieces = sets_of(sets, part.frame_count);
    for (Frames& piece : pieces)
      for (FrameIndex& f : piece) f = frames[static_cast<std::size_t>(f.value)];
    return pieces;
  }

  static constexpr std::int64_t kScanLimit = 10000;
  const FrameGraph& graph_;
  const TileOptions& options_;
  std::vector<std::int64_t> position_;  // -1 outside a call
};

// Appends `tree` with new node numbers and the given tile numbers. Returns the number of its root.
std::int64_t append(MergeTree& to, const MergeTree& tree, const std::vector<TileIndex>& tile_of_leaf) {
  const auto shift = static_cast<std::int64_t>(to.nodes.size());
  for (MergeTree::Node node : tree.nodes) {
    if (node.left >= 0) node.left += shift;
    if (node.right >= 0) node.right += shift;
    if (node.parent >= 0) node.parent += shift;
    if (node.tile.valid()) node.tile = tile_of_leaf[static_cast<std::size_t>(node.tile.value)];
    to.nodes.push_back(node);
  }
  return static_cast<std::int64_t>(to.nodes.size()) - 1;
}

// Joins roots in pairs, neighbours first, until one root is left.
std::int64_t join_all(MergeTree& tree, std::vector<std::int64_t> roots) {
  while (roots.size() > 1) {
    std::vector<std::int64_t> next;
    for (std::size_t i = 0; i + 1 < roots.size(); i += 2) next.push_back(join(tree, roots[i], roots[i + 1]));
    if (roots.size() % 2) next.push_back(roots.back());
    roots = std::move(next);
  }
  return roots.empty() ? -1 : roots.front();
}

bool weak_between_tiles(const Tiles& tiles, const FrameEdge& edge, const TileOptions& options) {
  return edge.weight < options.weak_link_tracks && tiles.tile_of_frame[edge.a] != tiles.tile_of_frame[edge.b];
}

void list_dropped(Tiles& tiles, const FrameGraph& graph, const TileOptions& options) {
  for (const FrameEdge& edge : graph.edges)
    if (weak_between_tiles(tiles, edge, options)) tiles.dropped_links.push_back(edge);
}

// Extends assignment, tree and components when frames are added to a block that has tiles.
class TileExtender {
 public:
  TileExtender(const FrameGraph& graph, const Tiles& previous, const TileOptions& options)
      : graph_(graph), previous_(previous), options_(options) {
    result_.tile_count = previous.tile_count;
    result_.tile_of_frame = previous.tile_of_frame;
    result_.tile_of_frame.resize(static_cast<std::size_t>(graph.frame_count));
    result_.component.assign(static_cast<std::size_t>(graph.frame_count), -1);
    result_.separator_depth = previous.separator_depth;
    result_.separator_depth.resize(static_cast<std::size_t>(graph.frame_count), -1);
    for (const std::int32_t depth : previous.separator_depth) below_ = std::max(below_, depth + 1);
    subtree_of_tile_.resize(static_cast<std::size_t>(previous.tile_count));
  }

  Tiles run() {
    join_strongest();
    add_new_sets();
    split_large_tiles();
    leave_points_to_former_frames();
    assemble();
    list_dropped(result_, graph_, options_);
    return std::move(result_);
  }

 private:
  TileIndex& tile_of(std::int64_t frame) { return result_.tile_of_frame[FrameIndex(frame)]; }

  // New frames join a tile one after the other, the one with most tracks to a tile first. A chain of new frames thus
  // follows its first frame.
  void join_strongest() {
    std::map<std::int64_t, std::vector<std::pair<std::int64_t, std::int64_t>>> links;  // new frame: (frame, weight)
    for (const FrameEdge& edge : graph_.edges) {
      if (!tile_of(edge.a.value).valid()) links[edge.a.value].push_back({edge.b.value, edge.weight});
      if (!tile_of(edge.b.value).valid()) links[edge.b.value].push_back({edge.a.value, edge.weight});
    }
    std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> weight;  // (new frame, tile)
    std::set<std::tuple<std::int64_t, std::int64_t, std::int64_t>> queue;  // (-weight, frame, tile)
    const auto add_link = [&](std::int64_t frame, std::int64_t tile, std::int64_t tracks) {
      std::int64_t& total = weight[{frame, tile}];
      queue.erase({-total, frame, tile});
      total += tracks;
      queue.insert({-total, frame, tile});
    };
    for (const auto& [frame, list] : links)
      for (const auto& [other, tracks] : list)
        if (tile_of(other).valid()) add_link(frame, tile_of(other).value, tracks);
    while (!queue.empty()) {
      const auto [negative, frame, tile] = *queue.begin();
      queue.erase(queue.begin());
      if (-negative < options_.weak_link_tracks) break;
      if (tile_of(frame).valid()) continue;
      tile_of(frame) = TileIndex(tile);
      for (const auto& [other, tracks] : links.at(frame))
        if (!tile_of(other).valid()) add_link(other, tile, tracks);
    }
  }

  // New frames without links to any tile become components and tiles of their own.
  void add_new_sets() {
    Frames rest;
    for (std::int64_t f = 0; f < graph_.frame_count; ++f)
      if (!tile_of(f).valid()) rest.push_back(FrameIndex(f));
    std::vector<std::int64_t> position(static_cast<std::size_t>(graph_.frame_count), -1);
    TileOptions options = options_;
    options.min_tiles = 1;
    const FrameGraph part = graph_of(graph_, rest, position);
    for (Component& component : TileMaker(part, options).components()) {
      Frames members;
      for (const FrameIndex frame : component.frames) members.push_back(rest[static_cast<std::size_t>(frame.value)]);
      for (std::size_t i = 0; i < members.size(); ++i)
        tile_of(members[i].value) = TileIndex(result_.tile_count + component.cut.leaf_of_node[i]);
      if (component.cut.tree.nodes.size() > 1)  // of more than one tile
        separate_parts(graph_of(part, component.frames, position), component.cut, members);
      new_trees_.push_back({std::move(component.cut.tree), result_.tile_count});
      for (const MergeTree::Node& node : new_trees_.back().first.nodes) result_.tile_count += node.tile.valid();
    }
  }

  // Bisects the tiles that have become too large.
  void split_large_tiles() {
    std::vector<Frames> members(static_cast<std::size_t>(previous_.tile_count));
    for (std::int64_t f = 0; f < graph_.frame_count; ++f)
      if (tile_of(f).valid() && tile_of(f).value < previous_.tile_count)
        members[static_cast<std::size_t>(tile_of(f).value)].push_back(FrameIndex(f));
    std::vector<std::int64_t> position(static_cast<std::size_t>(graph_.frame_count), -1);
    for (std::size_t t = 0; t < members.size(); ++t) {
      const Frames& frames = members[t];
      if (static_cast<std::int64_t>(frames.size()) <= options_.tile_max_frames) continue;
      const FrameGraph part = graph_of(graph_, frames, position);
      const BisectionTree cut = bisect(part, options_.tile_max_frames);
      separate_parts(part, cut, frames);
      const std::vector<TileIndex> numbers = numbers_of_parts(cut, frames, TileIndex(static_cast<std::int64_t>(t)));
      for (std::size_t i = 0; i < frames.size(); ++i)
        tile_of(frames[i].value) = numbers[static_cast<std::size_t>(cut.leaf_of_node[i])];
      append(subtree_of_tile_[t], cut.tree, numbers);
    }
  }

  // In tiles that stay whole, new frames count as the strongest separators, so that points which they see as well stay
  // where they are.
  void leave_points_to_former_frames() {
    for (auto f = static_cast<std::int64_t>(previous_.tile_of_frame.size()); f < graph_.frame_count; ++f) {
      const TileIndex tile = tile_of(f);
      const bool former = tile.valid() && tile.value < previous_.tile_count;
      if (former && subtree_of_tile_[static_cast<std::size_t>(tile.value)].nodes.empty())
        result_.separator_depth[FrameIndex(f)] = 0;
    }
  }

  // Separators of frames that are cut anew. They lie deeper than all separators of earlier frames, whose depths stay.
  void separate_parts(const FrameGraph& part, const BisectionTree& cut, const Frames& frames) {
    std::vector<std::uint8_t> apart;
    for (const FrameIndex frame : frames) apart.push_back(result_.separator_depth[frame] >= 0);
    const std::vector<std::int32_t> depth = separator_depths(part, cut.leaf_of_node, cut.tree, apart);
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (depth[i] >= 0) result_.separator_depth[frames[i]] = below_ + depth[i];
  }

  // Tile numbers of the parts of a bisected tile: the part with most of its earlier frames keeps the number.
  std::vector<TileIndex> numbers_of_parts(const BisectionTree& cut, const Frames& frames, TileIndex tile) {
    const std::size_t parts =
        1 + static_cast<std::size_t>(*std::max_element(cut.leaf_of_node.begin(), cut.leaf_of_node.end()));
    std::vector<std::int64_t> known(parts, 0);
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (previous_.tile_of_frame.contains(frames[i]) && previous_.tile_of_frame[frames[i]] == tile)
        ++known[static_cast<std::size_t>(cut.leaf_of_node[i])];
    const auto keeps = static_cast<std::size_t>(std::max_element(known.begin(), known.end()) - known.begin());
    std::vector<TileIndex> numbers(parts);
    for (std::size_t p = 0; p < parts; ++p) numbers[p] = p == keeps ? tile : TileIndex(result_.tile_count++);
    return numbers;
  }

  // Finds the components of the remaining links (a tile counts as connected). The new tree has, for each component, the
  // subtrees of the former tree and the trees of new sets, and a common root.
  void assemble() {
    DisjointSets sets(graph_.frame_count);
    std::vector<std::int64_t> first(static_cast<std::size_t>(result_.tile_count), -1);
    for (std::int64_t f = 0; f < graph_.frame_count; ++f) {
      if (!tile_of(f).valid()) continue;
      std::int64_t& lowest = first[static_cast<std::size_t>(tile_of(f).value)];
      if (lowest < 0) lowest = f;
      sets.unite(lowest, f);
    }
    for (const MergeTree& subtree : subtree_of_tile_) unite_tiles(subtree, first, sets);
    for (const FrameEdge& edge : graph_.edges)
      if (tile_of(edge.a.value).valid() && tile_of(edge.b.value).valid() &&
          !weak_between_tiles(result_, edge, options_))
        sets.unite(edge.a.value, edge.b.value);

    // sets_of leaves out single frames, but a tile of one frame that has lost its links remains a component.
    std::map<std::int64_t, std::int64_t> size;
    for (std::int64_t f = 0; f < graph_.frame_count; ++f)
      if (tile_of(f).valid()) ++size[sets.find(f)];
    std::vector<std::pair<std::int64_t, std::int64_t>> order;  // (-size, representative)
    for (const auto& [representative, count] : size) order.push_back({-count, representative});
    std::sort(order.begin(), order.end());
    std::map<std::int64_t, std::int32_t> number;
    for (const auto& [count, representative] : order)
      number.emplace(representative, static_cast<std::int32_t>(number.size()));
    for (std::int64_t f = 0; f < graph_.frame_count; ++f)
      if (tile_of(f).valid()) result_.component[FrameIndex(f)] = number.at(sets.find(f));

    component_of_tile_.resize(first.size());
    for (std::size_t t = 0; t < first.size(); ++t)
      component_of_tile_[t] = first[t] < 0 ? 0 : result_.component[FrameIndex(first[t])];
    build_tree(number.size());
  }

  static void unite_tiles(const MergeTree& subtree, const std::vector<std::int64_t>& first, DisjointSets& sets) {
    std::int64_t anchor = -1;
    for (const MergeTree::Node& node : subtree.nodes) {
      if (!node.tile.valid()) continue;
      const std::int64_t frame = first[static_cast<std::size_t>(node.tile.value)];
      if (anchor >= 0) sets.unite(anchor, frame);
      anchor = frame;
    }
  }

  void build_tree(std::size_t components) {
    // The largest subtrees of the former tree that lie within one component are kept as they are.
    const std::vector<MergeTree::Node>& old = previous_.tree.nodes;
    std::vector<std::int32_t> label(old.size(), -1);  // the component below a former node; -1: several
    for (std::size_t n = 0; n < old.size(); ++n) {
      const auto at = [&](std::int64_t i) { return label[static_cast<std::size_t>(i)]; };
      if (old[n].left < 0)
        label[n] = component_of_tile_[static_cast<std::size_t>(old[n].tile.value)];
      else
        label[n] = at(old[n].left) == at(old[n].right) ? at(old[n].left) : -1;
    }
    std::vector<std::vector<std::size_t>> kept(components), fresh(components);
    for (std::size_t n = 0; n < old.size(); ++n) {
      const std::int64_t parent = old[n].parent;
      if (label[n] >= 0 && (parent < 0 || label[static_cast<std::size_t>(parent)] < 0))
        kept[static_cast<std::size_t>(label[n])].push_back(n);
    }
    for (std::size_t i = 0; i < new_trees_.size(); ++i)
      fresh[static_cast<std::size_t>(component_of_tile_[static_cast<std::size_t>(new_trees_[i].second)])].push_back(i);
    std::vector<std::int64_t> roots;
    for (std::size_t c = 0; c < components; ++c) {
      std::vector<std::int64_t> parts;
      for (std::size_t n : kept[c]) parts.push_back(copy(static_cast<std::int64_t>(n)));
      for (std::size_t i : fresh[c]) {
        std::vector<TileIndex> numbers;
        for (std::int64_t t = new_trees_[i].second; t < result_.tile_count; ++t) numbers.push_back(TileIndex(t));
        parts.push_back(append(result_.tree, new_trees_[i].first, numbers));
      }
      roots.push_back(join_all(result_.tree, std::move(parts)));
    }
    join_all(result_.tree, std::move(roots));
  }

  // Copies a subtree of the former tree; a bisected tile is replaced by its own tree.
  std::int64_t copy(std::int64_t former) {
    const MergeTree::Node& node = previous_.tree.nodes[static_cast<std::size_t>(former)];
    if (node.left >= 0) {
      const std::int64_t left = copy(node.left);
      return join(result_.tree, left, copy(node.right));
    }
    const MergeTree& split = subtree_of_tile_[static_cast<std::size_t>(node.tile.value)];
    if (!split.nodes.empty()) {
      std::vector<TileIndex> same;
      for (std::int64_t t = 0; t < result_.tile_count; ++t) same.push_back(TileIndex(t));
      return append(result_.tree, split, same);
    }
    MergeTree::Node leaf;
    leaf.tile = node.tile;
    result_.tree.nodes.push_back(leaf);
    return static_cast<std::int64_t>(result_.tree.nodes.size()) - 1;
  }

  const FrameGraph& graph_;
  const Tiles& previous_;
  const TileOptions& options_;
  Tiles result_;
  std::int32_t below_ = 0;                                     // deeper than all separators of `previous`
  std::vector<MergeTree> subtree_of_tile_;                     // of bisected former tiles, with final tile numbers
  std::vector<std::pair<MergeTree, std::int64_t>> new_trees_;  // trees of new sets, with the number of their first tile
  std::vector<std::int32_t> component_of_tile_;
};

}  // namespace

void TileOptions::check() const {
  const auto require = [](bool ok, const char* message) {
    if (!ok) throw InputError(message);
  };
  require(tile_max_frames >= 2, "tile_max_frames must be at least 2");
  require(min_tiles >= 1, "min_tiles must be at least 1");
  require(min_tiles_from >= 2, "min_tiles_from must be at least 2");
  require(weak_link_tracks >= 1, "weak_link_tracks must be at least 1");
}

Tiles make_tiles(const FrameGraph& graph, const TileOptions& options) {
  options.check();
  Tiles tiles;
  tiles.tile_of_frame.resize(static_cast<std::size_t>(graph.frame_count));
  tiles.component.assign(static_cast<std::size_t>(graph.frame_count), -1);
  std::vector<std::int64_t> roots;
  for (const Component& component : TileMaker(graph, options).components()) {
    std::vector<TileIndex> numbers;
    for (const MergeTree::Node& node : component.cut.tree.nodes)
      if (node.tile.valid()) numbers.push_back(TileIndex(tiles.tile_count++));
    for (std::size_t i = 0; i < component.frames.size(); ++i) {
      tiles.tile_of_frame[component.frames[i]] = numbers[static_cast<std::size_t>(component.cut.leaf_of_node[i])];
      tiles.component[component.frames[i]] = static_cast<std::int32_t>(roots.size());
    }
    roots.push_back(append(tiles.tree, component.cut.tree, numbers));
  }
  join_all(tiles.tree, std::move(roots));
  list_dropped(tiles, graph, options);
  std::vector<std::int32_t> leaf_of_frame;
  leaf_of_frame.reserve(tiles.tile_of_frame.size());
  for (const TileIndex tile : tiles.tile_of_frame) leaf_of_frame.push_back(static_cast<std::int32_t>(tile.value));
  tiles.separator_depth = IndexedVector<FrameIndex, std::int32_t>(separator_depths(graph, leaf_of_frame, tiles.tree));
  return tiles;
}

Tiles extend_tiles(const FrameGraph& graph, const Tiles& previous, const TileOptions& options) {
  options.check();
  if (previous.tile_count == 0) return make_tiles(graph, options);
  if (static_cast<std::int64_t>(previous.tile_of_frame.size()) > graph.frame_count)
    throw InputError(
        "tiles: the block has fewer frames than when its tiles were cut; start a new job in another folder");
  return TileExtender(graph, previous, options).run();
}

}  // namespace megablock
