// Adds up the links between frames of a block into its graph, in memory of the order of the graph: sums are kept
// sorted, new links wait behind them until they are half as many.
#pragma once

#include <cstdint>
#include <vector>

#include "io/image_graph.h"

namespace megablock {

class LinkWeights {
 public:
  // `tracks` more between two frames; nothing when they are the same.
  void add(FrameIndex a, FrameIndex b, std::int64_t tracks);
  // The links among the first `frames` frames. Does not depend on the order of add().
  FrameGraph graph(std::int64_t frames) &;
  FrameGraph graph(std::int64_t frames) &&;  // in the memory of the sums

 private:
  void sum_up();
  std::vector<FrameEdge> edges_;
  std::size_t summed_ = 0;  // rows that are ascending and distinct
};

}  // namespace megablock
