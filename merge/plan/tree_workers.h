// Visits the cells of a tile along their tree, on all threads of the process (geometry/threads/workers.h). A node is
// visited after its children (elimination), or after its parent (covariances).
// Internal to merge/: it is not installed.
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

// Visits all nodes of a tree, children first. The thread that has visited a leaf goes on to the parent when the sibling
// is done too, and so on upwards. No thread ever waits for another: of two siblings, the thread that is done first
// takes the next leaf, and the other one goes up.
class ChildrenFirst {
 public:
  explicit ChildrenFirst(const std::vector<PlanNode>& nodes)  // `nodes` outlives the object
      : nodes_(nodes), errors_(nodes.size()), open_children_(nodes.size()) {
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (nodes[n].leaf >= 0) leaves_.push_back(static_cast<std::int64_t>(n));
      open_children_[n] = nodes[n].leaf >= 0 ? 0 : 2;
    }
  }
  std::int64_t leaves() const { return std::ssize(leaves_); }
  // Calls visit(n) for leaf number `leaf` and for the nodes above it that this completes. Call it once for each leaf,
  // on any thread.
  template <typename Visit>
  void ascend(std::int64_t leaf, const Visit& visit) {
    for (std::int64_t n = leaves_[static_cast<std::size_t>(leaf)];;) {
      visit_unless_failed(n, visit);
      n = nodes_[static_cast<std::size_t>(n)].parent;
      // Of the two threads that come up here, the second goes on. It must see everything that the first one has written
      // below (release), hence the order of memory.
      if (n < 0 || open_children_[static_cast<std::size_t>(n)].fetch_sub(1, std::memory_order_acq_rel) > 1) return;
    }
  }
  // Rethrows an error after all leaves are visited. Of two children with errors the left one's counts; nodes above a
  // failed one are not visited.
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

// Calls visit(n) for all nodes of a tree, children first, on all threads. Exceptions are handled as by
// visit_in_parallel; nodes above a failed one are not visited.
template <typename Visit>
void visit_children_first(const std::vector<PlanNode>& nodes, Visit&& visit) {
  ChildrenFirst tree(nodes);
  visit_in_parallel(tree.leaves(), [&](std::int64_t leaf) { tree.ascend(leaf, visit); });
  tree.rethrow();
}

// Calls visit(n, parent) for all nodes of a tree, parents first, with subtrees on different threads. `parent` points to
// the value that visit() returned for the parent, and is nullptr at the root. A value is freed when the subtree of its
// node is done. Exceptions are handled as above; nodes below a failed one are not visited.
template <typename Value, typename Visit>
// So only the values along the paths at work are in memory.
void visit_parents_first(const std::vector<PlanNode>& nodes, Visit&& visit) {
  std::vector<std::exception_ptr> errors(nodes.size());
  // `value` lives in the frame of this call until both subtrees are done (taskwait).
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
