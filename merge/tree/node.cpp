#include "merge/tree/node.h"

#include <algorithm>
#include <utility>

namespace megablock {

namespace {

class DenseNodeSolver final : public NodeSolver {
 public:
  Front::Result eliminate(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda) const override {
    Front front(node.eliminated, node.separator, std::max(left.right_hand_sides, right.right_hand_sides));
    for (UpdateMatrix* child : {&left, &right}) {
      front.add(*child);
      *child = UpdateMatrix();  // frees its memory
    }
    return std::move(front).eliminate(lambda);
  }
  Step back_substitute(const FrontFactor& factor, const Step& parent) const override {
    return megablock::back_substitute(factor, parent);
  }
  FrontCovariance covariance(const FrontFactor& factor, CovarianceMatrix separator) const override {
    return covariance_down(factor, std::move(separator));
  }
};

}  // namespace

const NodeSolver& dense_node_solver() {
  static const DenseNodeSolver solver;
  return solver;
}

}  // namespace megablock
