// The threads of the process (geometry/workers.h) at work on the cells of a tile, by their tree.
#pragma once

#include <omp.h>

#include <cstdint>
#include <exception>
#include <functional>
#include <vector>

#include "geometry/workers.h"
#include "merge/plan.h"

namespace megablock {

// Calls visit(n) for all nodes of a tree, children first, subtrees on different threads. Exceptions as
// visit_in_parallel; nodes above one that threw are left out.
template <typename Visit>
void visit_children_first(const std::vector<PlanNode>& nodes, Visit&& visit) {
  std::vector<std::exception_ptr> errors(nodes.size());
  const std::function<void(std::int64_t)> descend = [&](std::int64_t n) {
    const PlanNode& node = nodes[static_cast<std::size_t>(n)];
    std::exception_ptr& error = errors[static_cast<std::size_t>(n)];
    if (node.leaf < 0) {
#pragma omp task default(shared) firstprivate(n)
      descend(node.left);
      descend(node.right);
#pragma omp taskwait
      const std::exception_ptr& left = errors[static_cast<std::size_t>(node.left)];
      error = left ? left : errors[static_cast<std::size_t>(node.right)];
      if (error) return;
    }
    try {
      visit(n);
    } catch (...) {
      error = std::current_exception();
    }
  };
#pragma omp parallel
#pragma omp single
  descend(static_cast<std::int64_t>(nodes.size()) - 1);
  if (errors.back()) std::rethrow_exception(errors.back());
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
