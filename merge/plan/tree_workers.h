// The threads of the process (geometry/threads/workers.h) at work on the cells of a tile, by their tree.
#pragma once

#include <omp.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <vector>

#include "geometry/threads/workers.h"
#include "merge/plan/plan.h"

namespace megablock {

// All nodes of a tree, children first, from its leaves: whoever has visited a leaf goes on upwards as long as what is
// beside its way is done.
class ChildrenFirst {
 public:
  explicit ChildrenFirst(const std::vector<PlanNode>& nodes)  // outlives it
      : nodes_(nodes), errors_(nodes.size()), open_children_(nodes.size()) {
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (nodes[n].leaf >= 0) leaves_.push_back(static_cast<std::int64_t>(n));
      open_children_[n] = nodes[n].leaf >= 0 ? 0 : 2;
    }
  }
  std::int64_t leaves() const { return std::ssize(leaves_); }
  // Calls visit(n) for leaf number `leaf` and the nodes above that it completes. Once for each leaf, by any thread.
  template <typename Visit>
  void ascend(std::int64_t leaf, const Visit& visit) {
    for (std::int64_t n = leaves_[static_cast<std::size_t>(leaf)];;) {
      visit_unless_failed(n, visit);
      n = nodes_[static_cast<std::size_t>(n)].parent;
      if (n < 0 || open_children_[static_cast<std::size_t>(n)].fetch_sub(1, std::memory_order_acq_rel) > 1) return;
    }
  }
  // Once all is visited: the error of the lowest left-most node that has one; those above it are left out.
  void rethrow() const {
    if (errors_.back()) std::rethrow_exception(errors_.back());
  }

 private:
  template <typename Visit>
  void visit_unless_failed(std::int64_t n, const Visit& visit) {
    const PlanNode& node = nodes_[static_cast<std::size_t>(n)];
    std::exception_ptr& error = errors_[static_cast<std::size_t>(n)];
    for (const std::int64_t child : {node.left, node.right})
      if (node.leaf < 0 && !error) error = errors_[static_cast<std::size_t>(child)];
    if (error) return;
    try {
      visit(n);
    } catch (...) {
      error = std::current_exception();
    }
  }

  const std::vector<PlanNode>& nodes_;
  std::vector<std::exception_ptr> errors_;
  std::vector<std::atomic<int>> open_children_;
  std::vector<std::int64_t> leaves_;
};

// Calls visit(n) for all nodes of a tree, children first, on all threads. Exceptions as visit_in_parallel; nodes above
// one that threw are left out.
template <typename Visit>
void visit_children_first(const std::vector<PlanNode>& nodes, Visit&& visit) {
  ChildrenFirst tree(nodes);
  visit_in_parallel(tree.leaves(), [&](std::int64_t leaf) { tree.ascend(leaf, visit); });
  tree.rethrow();
}

// Calls visit(n, parent) for all nodes of a tree, parents first, subtrees on different threads. What it returns is
// given to the children, as `parent`, and forgotten behind them; the root's is nullptr. As above; nodes below one that
// threw are left out.
template <typename Value, typename Visit>
void visit_parents_first(const std::vector<PlanNode>& nodes, Visit&& visit) {
  std::vector<std::exception_ptr> errors(nodes.size());
  const std::function<void(std::int64_t, const Value*)> descend = [&](std::int64_t n, const Value* parent) {
    const PlanNode& node = nodes[static_cast<std::size_t>(n)];
    try {
      const Value value = visit(n, parent);
      if (node.leaf >= 0) return;
#pragma omp task default(shared)
      descend(node.left, &value);
      descend(node.right, &value);
#pragma omp taskwait
    } catch (...) {
      errors[static_cast<std::size_t>(n)] = std::current_exception();
    }
  };
#pragma omp parallel
#pragma omp single
  descend(static_cast<std::int64_t>(nodes.size()) - 1, nullptr);
  for (const std::exception_ptr& error : errors)
    if (error) std::rethrow_exception(error);
}

}  // namespace megablock
