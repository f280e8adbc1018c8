#include "partition/links/link_weights.h"

#include <algorithm>
#include <limits>
#include <string>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr std::int64_t kLargest = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kMore = 4;  // links that a frame's list grows by: there are many frames, each with few links

}  // namespace

void LinkWeights::add(FrameIndex a, FrameIndex b, std::int64_t tracks) {
  if (a == b) return;
  const auto first = static_cast<std::size_t>(std::min(a, b).value);
  const std::int64_t apart = std::max(a, b).value - std::min(a, b).value;
  if (apart > kLargest)
    throw ComputeError("frames " + std::to_string(a.value) + " and " + std::to_string(b.value) +
                       " are linked, but a block holds at most 2^32 frames; divide it into several blocks");
  // The distance to the later frame needs four bytes instead of eight.
  const auto further = static_cast<std::uint32_t>(apart);
  if (first >= links_.size()) links_.resize(first + 1);
  std::vector<Link>& links = links_[first];
  const auto it = std::lower_bound(links.begin(), links.end(), further,
                                   [](const Link& link, std::uint32_t value) { return link.further < value; });
  const bool known = it != links.end() && it->further == further;
  const auto sum =
      static_cast<std::uint32_t>(std::min(kLargest, (known ? it->tracks : 0) + std::min(kLargest, tracks)));
  if (known) {
    it->tracks = sum;
    return;
  }
  const auto place = it - links.begin();
  if (links.size() == links.capacity()) links.reserve(links.size() + kMore);
  links.insert(links.begin() + place, {further, sum});
}

FrameGraph LinkWeights::graph(std::int64_t frames) const {
  const auto within = [&](const FrameEdge& edge) { return edge.b.value < frames; };
  // Counting first avoids a list that is reallocated, and thus held twice, while it grows.
  std::size_t count = 0;
  visit([&](const FrameEdge& edge) { count += within(edge); });
  FrameGraph graph{frames, {}};
  graph.edges.reserve(count);
  visit([&](const FrameEdge& edge) {
    if (within(edge)) graph.edges.push_back(edge);
  });
  return graph;
}

}  // namespace megablock
