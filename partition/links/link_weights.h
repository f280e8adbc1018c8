// Adds up the links between frames of a block into its graph: of every frame a list of its links to later ones, of 8
// bytes each and what a list that grows has in reserve.
#pragma once

#include <cstdint>
#include <vector>

#include "io/block/image_graph.h"

namespace megablock {

class LinkWeights {
 public:
  // `tracks` more between two frames, 2^32 - 1 in all at most; nothing when they are the same. Throws ComputeError for
  // frames that are 2^32 apart.
  void add(FrameIndex a, FrameIndex b, std::int64_t tracks);
  // The links among the first `frames` frames. Does not depend on the order of add().
  FrameGraph graph(std::int64_t frames) const;
  bool empty() const { return links_.empty(); }
  // Calls visit(FrameEdge) for every link, ascending.
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
    std::uint32_t further;  // the later frame is so many frames on
    std::uint32_t tracks;
  };
  std::vector<std::vector<Link>> links_;  // [earlier frame], ascending
};

}  // namespace megablock
