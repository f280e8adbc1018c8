#include "merge/node.h"

namespace megablock {

Front::Result eliminate_node(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda) {
  Front front(node.eliminated, node.passed, std::max(left.right_hand_sides, right.right_hand_sides));
  for (UpdateMatrix* child : {&left, &right}) {
    front.add(*child);
    *child = UpdateMatrix();  // its memory is wanted
  }
  return std::move(front).eliminate(lambda);
}

Step back_substitute_node(const FrontFactor& factor, const Step& parent) { return back_substitute(factor, parent); }

FrontCovariance covariance_node(const FrontFactor& factor, CovarianceMatrix passed) {
  return covariance_down(factor, std::move(passed));
}

}  // namespace megablock
