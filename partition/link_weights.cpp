#include "partition/link_weights.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>

namespace megablock {

namespace {

std::uint32_t narrow(std::int64_t value) {
  if (value < 0 || value > std::numeric_limits<std::uint32_t>::max())
    throw std::overflow_error("links of frames: " + std::to_string(value) + " does not fit in 32 bits");
  return static_cast<std::uint32_t>(value);
}

}  // namespace

void LinkWeights::add(FrameIndex a, FrameIndex b, std::int64_t tracks) {
  if (a == b) return;
  const auto first = static_cast<std::size_t>(std::min(a, b).value);
  const std::uint32_t further = narrow(std::max(a, b).value - std::min(a, b).value);
  if (first >= links_.size()) links_.resize(first + 1);
  std::vector<Link>& links = links_[first];
  const auto it = std::lower_bound(links.begin(), links.end(), further,
                                   [](const Link& link, std::uint32_t value) { return link.further < value; });
  if (it != links.end() && it->further == further)
    it->tracks = narrow(it->tracks + tracks);
  else
    links.insert(it, {further, narrow(tracks)});
}

FrameGraph LinkWeights::graph(std::int64_t frames) const {
  const auto visit = [&](auto&& visit_edge) {
    for (std::size_t first = 0; first < links_.size(); ++first)
      for (const Link& link : links_[first]) {
        const auto a = static_cast<std::int64_t>(first), b = a + link.further;
        if (b < frames) visit_edge(FrameEdge{FrameIndex(a), FrameIndex(b), link.tracks});
      }
  };
  std::size_t count = 0;
  visit([&](const FrameEdge&) { ++count; });
  FrameGraph graph{frames, {}};
  graph.edges.reserve(count);
  visit([&](const FrameEdge& edge) { graph.edges.push_back(edge); });
  return graph;
}

}  // namespace megablock
