// Values on their way down the merge tree: a step or covariances of the unknowns that a node passes to its parent.
// Internal to merge/tree/.
#pragma once

#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// Messages of the two directions never mix: an upward pass has ended everywhere (its root is broadcast) before a
// downward one begins, and the other way round (its sums are gathered).
template <typename Values>
void MergeTreeRunner::pass_down(std::int64_t n, const Values& front) {
  const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
  for (const std::int64_t child : {node.left, node.right}) {
    Bytes bytes = front.bytes_of(plan_.nodes[static_cast<std::size_t>(child)].passed);
    if (mine(child))
      downward_[child] = std::move(bytes);
    else
      ranks_.send(rank_of_node_[static_cast<std::size_t>(child)], static_cast<int>(child), std::move(bytes));
  }
}

template <typename Values>
Values MergeTreeRunner::from_parent(std::int64_t n) {
  const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(n)].parent;
  if (parent < 0) return {};
  if (!mine(parent))
    return Values::from_bytes(ranks_.receive(rank_of_node_[static_cast<std::size_t>(parent)], static_cast<int>(n)));
  const Bytes bytes = std::move(downward_.at(n));
  downward_.erase(n);
  return Values::from_bytes(bytes);
}

}  // namespace megablock
