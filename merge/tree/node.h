// The elimination at an inner node or the root of the merge tree. The runner of the tree (merge_tree_runner.h) moves
// the updates up and the steps down.
#pragma once

#include <vector>

#include "merge/front/front.h"
#include "merge/plan/plan.h"

namespace megablock {

// The interface of the solver of a node. A front that is too large for one rank would take another implementation,
// which spreads it over several ranks; its factors, steps and covariances have the same form.
class NodeSolver {
 public:
  virtual ~NodeSolver() = default;

  // Adds the children, left before right, damps the unknowns that complete at `node` and eliminates them.
  virtual Front::Result eliminate(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda) const = 0;

  // Step of the node's front (eliminated and passed unknowns) from the step of its parent's front; at the root `parent`
  // is empty. The child's boundary step is inside it.
  virtual Step back_substitute(const FrontFactor& factor, const Step& parent) const = 0;

  // Covariance of the node's front from that of the unknowns that it passes to its parent.
  virtual FrontCovariance covariance(const FrontFactor& factor, CovarianceMatrix passed) const = 0;
};

// The whole front in this process's memory (front.h). Stateless.
const NodeSolver& dense_node_solver();

}  // namespace megablock
