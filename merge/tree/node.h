// Eliminates the unknowns of an inner node or of the root of the merge tree, and computes steps and covariances from
// the factors. The runner of the tree (merge_tree_runner.h) sends the updates up and the steps down.
#pragma once

#include <vector>

#include "merge/front/front.h"
#include "merge/plan/plan.h"

namespace megablock {

// The interface of the solver of a node. A front that is too large for one rank needs another implementation, which
// spreads the front over several ranks. Its factors, steps and covariances would have the same form.
class NodeSolver {
 public:
  virtual ~NodeSolver() = default;

  // Adds the updates of the children, the left one first, damps the unknowns that are eliminated at `node`, and
  // eliminates them. The formulas and the treatment of vanished pivots are those of front.h. The updates are given by
  // value, so that their memory can be freed during the elimination.
  virtual Front::Result eliminate(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda) const = 0;

  // The step of all unknowns of the node's front, from the step of its separator unknowns. `parent` has these unknowns
  // and perhaps others; at the root it is empty.
  virtual Step back_substitute(const FrontFactor& factor, const Step& parent) const = 0;

  // The covariance of the node's front from the covariance of its separator unknowns.
  virtual FrontCovariance covariance(const FrontFactor& factor, CovarianceMatrix separator) const = 0;
};

// Keeps the whole front in the memory of this process (front.h). Stateless.
const NodeSolver& dense_node_solver();

}  // namespace megablock
