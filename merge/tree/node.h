// Inner nodes and the root of the merge tree. merge/ knows no MPI: whoever calls these operations moves the update
// matrices up and the steps down.
#pragma once

#include <vector>

#include "merge/front/front.h"
#include "merge/plan/plan.h"

namespace megablock {

// How a node is solved. A front that no rank can hold is a matter of another implementation, which spreads it over
// several; its factor, steps and covariances are of the same form.
class NodeSolver {
 public:
  virtual ~NodeSolver() = default;

  // Adds the children, left before right, damps and eliminates what completes at `node`.
  virtual Front::Result eliminate(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda) const = 0;

  // Step of the node's front (eliminated and passed unknowns) from the step of its parent's front; at the root `parent`
  // is empty. The child's boundary step is inside it.
  virtual Step back_substitute(const FrontFactor& factor, const Step& parent) const = 0;

  // Covariance of the node's front from that of what it passes on.
  virtual FrontCovariance covariance(const FrontFactor& factor, CovarianceMatrix passed) const = 0;
};

// The whole front in this process's memory (front.h). Stateless.
const NodeSolver& dense_node_solver();

}  // namespace megablock
