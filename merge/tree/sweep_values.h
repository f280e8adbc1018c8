// Sends values down the merge tree: each child gets from its parent the steps or covariances of its separator unknowns.
// These are the unknowns that the sweep up has not eliminated in the subtree of the child; their condensed normal
// equations went to the parent as an update.
// Internal to merge/tree/.
#pragma once

#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// The messages of sweeps up and sweeps down never mix. A sweep up has ended on all ranks before a sweep down begins,
// because the values of its root are broadcast. A sweep down has ended on all ranks before the next sweep up begins,
// because its sums are gathered.
template <typename Values>
void MergeTreeRunner::send_down(std::int64_t n, const Values& front) {
  const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
  for (const std::int64_t child : {node.left, node.right}) {
    Bytes bytes = front.bytes_of(plan_.nodes[static_cast<std::size_t>(child)].separator);
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
