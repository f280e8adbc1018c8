// Adds up the links between frames (numbers of common tracks) into the graph of the block. Each frame has a list of its
// links to later frames, with 8 bytes per link plus the reserve of a growing list.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/image_graph.h"

namespace megablock {

class LinkWeights {
 public:
  // Adds `tracks` to the link of two frames, up to 2^32 - 1 in all. Ignores a link of a frame with itself. Throws
  // ComputeError for frames that are 2^32 or more apart.
  void add(FrameIndex a, FrameIndex b, std::int64_t tracks);
  // The links among the first `frames` frames. The result does not depend on the order of the calls of add().
  FrameGraph graph(std::int64_t frames) const;
  bool empty() const { return links_.empty(); }
  // Calls visit_edge(FrameEdge) for every link, ascending.
  template <typename Visit>
  void visit(Visit&& visit_edge) const {
    for (std::size_t first = 0; first < links_.size(); ++first)
      for (const Link& link : links_[first]) {
        const auto a = static_cast<std::int64_t>(first);
        visit_edge(FrameEdge{FrameIndex(a), FrameIndex(a + link.further), link.tracks});
      }
  }

 private:
  struct Link {
    std::uint32_t further;  // distance of the later frame from the earlier one
    std::uint32_t tracks;
  };
  std::vector<std::vector<Link>> links_;  // [earlier frame] ascending
};

}  // namespace megablock
