// Inner nodes and the root of the merge tree. merge/ knows no MPI: these are pure functions, whoever calls them moves
// the update matrices up and the steps down.
#pragma once

#include <vector>

#include "merge/front.h"
#include "merge/plan.h"

namespace megablock {

// Adds the children, left before right, damps and eliminates what completes at `node`.
Front::Result eliminate_node(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda);

// Step of the node's front (eliminated and passed unknowns) from the step of its parent's front; at the root `parent`
// is empty. The child's boundary step is inside it.
Step back_substitute_node(const FrontFactor& factor, const Step& parent);

// Covariance of the node's front from that of what it passes on.
FrontCovariance covariance_node(const FrontFactor& factor, CovarianceMatrix passed);

}  // namespace megablock
