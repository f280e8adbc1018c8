#include "partition/link_weights.h"

#include <algorithm>
#include <utility>

namespace megablock {

void LinkWeights::add(FrameIndex a, FrameIndex b, std::int64_t tracks) {
  constexpr std::size_t kLeastWaiting = std::size_t{1} << 16;
  if (a == b) return;
  edges_.push_back({std::min(a, b), std::max(a, b), tracks});
  if (edges_.size() - summed_ > std::max(kLeastWaiting, summed_ / 2)) sum_up();
}

void LinkWeights::sum_up() {
  const auto middle = edges_.begin() + static_cast<std::ptrdiff_t>(summed_);
  std::sort(middle, edges_.end());
  std::inplace_merge(edges_.begin(), middle, edges_.end());
  summed_ = 0;
  for (const FrameEdge& edge : edges_) {
    if (summed_ > 0 && edges_[summed_ - 1].a == edge.a && edges_[summed_ - 1].b == edge.b)
      edges_[summed_ - 1].weight += edge.weight;
    else
      edges_[summed_++] = edge;
  }
  edges_.resize(summed_);
}

FrameGraph LinkWeights::graph(std::int64_t frames) & {
  LinkWeights copy = *this;
  return std::move(copy).graph(frames);
}

FrameGraph LinkWeights::graph(std::int64_t frames) && {
  sum_up();
  std::erase_if(edges_, [&](const FrameEdge& edge) { return edge.b.value >= frames; });
  FrameGraph graph{frames, std::exchange(edges_, {})};
  graph.edges.shrink_to_fit();
  summed_ = 0;
  return graph;
}

}  // namespace megablock
