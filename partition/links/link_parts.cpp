#include "partition/links/link_parts.h"

#include <algorithm>
#include <numeric>

#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

struct GoodLink {
  FrameIndex a, b;
  std::int64_t points;
};

// Calls visit(a, b, points) for every link of enough points, then for every relative pose (points = 0), between frames
// with a pose.
template <typename Visit>
void visit_good_links(const Block& block, const BlockState& state, const LinkWeights& links, std::int64_t enough,
                      Visit&& visit) {
  const auto oriented = [&](FrameIndex a, FrameIndex b) { return a != b && state.oriented[a] && state.oriented[b]; };
  links.visit([&](const FrameEdge& edge) {
    if (edge.weight >= enough && oriented(edge.a, edge.b)) visit(edge.a, edge.b, edge.weight);
  });
  for (const RelativePose& pose : block.relative_poses)
    if (oriented(pose.from, pose.to)) visit(std::min(pose.from, pose.to), std::max(pose.from, pose.to), 0);
}

// Returns enough of the good links to tell which of them are bridges, fewer than two per frame: a spanning forest, and
// a spanning forest of the remaining links (H. Nagamochi and T. Ibaraki, Algorithmica 7, 1992). However the frames are
// divided into two parts, the first forest contains a link between them, and the second another one if there is one.
// `sets` becomes the connected parts. A relative pose between frames that a link joins already is no second link.
std::vector<GoodLink> two_forests(const Block& block, const BlockState& state, const LinkWeights& links,
                                  std::int64_t enough, DisjointSets& sets) {
  std::vector<GoodLink> forests;
  DisjointSets second(static_cast<std::int64_t>(state.oriented.size()));
  IndexedVector<FrameIndex, std::vector<FrameIndex>> joined(state.oriented.size());  // by links of the forests
  visit_good_links(block, state, links, enough, [&](FrameIndex a, FrameIndex b, std::int64_t points) {
    if (points == 0 && std::ranges::find(joined[a], b) != joined[a].end()) return;
    if (!sets.unite(a.value, b.value) && !second.unite(a.value, b.value)) return;
    joined[a].push_back(b);
    forests.push_back({a, b, points});
  });
  return forests;
}

// Finds bridges by depth-first search, without recursion, and counts the frames beyond each (R. E. Tarjan, 1974). A
// link of the search tree is a bridge if no link from below leads to the frame above it or higher.
class Bridges {
 public:
  Bridges(std::int64_t frames, const std::vector<GoodLink>& links) : links_(links) {
    const auto n = static_cast<std::size_t>(frames);
    // Links of each frame in compressed rows: count, sum up, fill in.
    begin_.assign(n + 1, 0);
    for (const GoodLink& link : links) {
      ++begin_[static_cast<std::size_t>(link.a.value) + 1];
      ++begin_[static_cast<std::size_t>(link.b.value) + 1];
    }
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    ends_.resize(2 * links.size());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t l = 0; l < links.size(); ++l) {
      ends_[next[static_cast<std::size_t>(links[l].a.value)]++] = l;
      ends_[next[static_cast<std::size_t>(links[l].b.value)]++] = l;
    }
    number_.assign(n, -1);
    lowest_.assign(n, -1);
    below_.assign(n, 1);
  }

  // Calls found(link, number of frames beyond it) for each bridge.
  template <typename Found>
  void find(Found&& found) {
    struct Step {
      std::size_t frame, by, next;  // by: the link on which the frame was reached
    };
    std::vector<Step> path;
    std::int64_t numbers = 0;
    for (std::size_t root = 0; root < number_.size(); ++root) {
      if (number_[root] >= 0) continue;
      number_[root] = lowest_[root] = numbers++;
      path.push_back({root, links_.size(), begin_[root]});
      while (!path.empty()) {
        Step& step = path.back();
        const std::size_t frame = step.frame;
        if (step.next < begin_[frame + 1]) {
          const std::size_t link = ends_[step.next++];
          if (link == step.by) continue;
          const auto a = static_cast<std::size_t>(links_[link].a.value),
                     b = static_cast<std::size_t>(links_[link].b.value);
          const std::size_t other = a == frame ? b : a;
          if (number_[other] >= 0) {
            lowest_[frame] = std::min(lowest_[frame], number_[other]);
          } else {
            number_[other] = lowest_[other] = numbers++;
            path.push_back({other, link, begin_[other]});
          }
          continue;
        }
        // All links of the frame are done: hand its lowest number and its count to the frame above.
        const std::size_t by = step.by;
        path.pop_back();
        if (path.empty()) break;
        const std::size_t above = path.back().frame;
        lowest_[above] = std::min(lowest_[above], lowest_[frame]);
        below_[above] += below_[frame];
        if (lowest_[frame] > number_[above]) found(by, below_[frame]);
      }
    }
  }

 private:
  const std::vector<GoodLink>& links_;
  std::vector<std::size_t> begin_, ends_;
  std::vector<std::int64_t> number_, lowest_, below_;
};

// Numbers the parts by falling number of frames.
void number_parts(const BlockState& state, DisjointSets& sets, BlockDiagnostics& d) {
  const std::size_t n = state.oriented.size();
  std::vector<std::int64_t> size(n, 0);
  for (std::size_t f = 0; f < n; ++f)
    if (state.oriented[FrameIndex(static_cast<std::int64_t>(f))])
      ++size[static_cast<std::size_t>(sets.find(static_cast<std::int64_t>(f)))];
  std::vector<std::size_t> roots;
  for (std::size_t f = 0; f < n; ++f)
    if (size[f] > 0) roots.push_back(f);
  std::stable_sort(roots.begin(), roots.end(), [&](std::size_t a, std::size_t b) { return size[a] > size[b]; });
  std::vector<std::int32_t> part(n, -1);
  for (std::size_t p = 0; p < roots.size(); ++p) {
    part[roots[p]] = static_cast<std::int32_t>(p);
    d.part_frames.push_back(size[roots[p]]);
  }
  d.part_of_frame.assign(n, -1);
  for (FrameIndex f(0); state.oriented.contains(f); ++f.value)
    if (state.oriented[f]) d.part_of_frame[f] = part[static_cast<std::size_t>(sets.find(f.value))];
}

}  // namespace

void find_link_parts(const Block& block, const BlockState& state, const LinkWeights& links, BlockDiagnostics& d) {
  if (!d.links_known) {
    d.part_of_frame.assign(state.oriented.size(), -1);
    return;
  }
  // The two forests contain every bridge and are small, so the search does not depend on the number of links.
  DisjointSets sets(static_cast<std::int64_t>(state.oriented.size()));
  const std::vector<GoodLink> good = two_forests(block, state, links, d.requested.min_link_points, sets);
  number_parts(state, sets, d);
  links.visit([&](const FrameEdge& edge) {
    const std::int32_t a = d.part_of_frame[edge.a], b = d.part_of_frame[edge.b];
    if (a >= 0 && b >= 0 && a != b) d.weak_links.push_back({edge.a, edge.b, edge.weight, 0});
  });
  Bridges(static_cast<std::int64_t>(state.oriented.size()), good).find([&](std::size_t l, std::int64_t below) {
    const GoodLink& link = good[l];
    const std::int64_t whole = d.part_frames[static_cast<std::size_t>(d.part_of_frame[link.a])];
    const std::int64_t smaller = std::min(below, whole - below);
    if (smaller >= 2 && link.points > 0) d.single_links.push_back({link.a, link.b, link.points, smaller});
  });
  std::sort(d.single_links.begin(), d.single_links.end(),
            [](const auto& x, const auto& y) { return std::pair(x.a, x.b) < std::pair(y.a, y.b); });
}

}  // namespace megablock
