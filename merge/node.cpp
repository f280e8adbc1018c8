#include "merge/node.h"

namespace megablock {

Front::Result eliminate_node(const PlanNode& node, const std::vector<const UpdateMatrix*>& children, double lambda) {
  std::int64_t right_hand_sides = 1;
  for (const UpdateMatrix* child : children) right_hand_sides = std::max(right_hand_sides, child->right_hand_sides);
  Front front(node.eliminated, node.passed, right_hand_sides);
  for (const UpdateMatrix* child : children) front.add(*child);
  return std::move(front).eliminate(lambda);
}

Step back_substitute_node(const FrontFactor& factor, const Step& parent) { return back_substitute(factor, parent); }

FrontCovariance covariance_node(const FrontFactor& factor, CovarianceMatrix passed) {
  return covariance_down(factor, std::move(passed));
}

}  // namespace megablock
