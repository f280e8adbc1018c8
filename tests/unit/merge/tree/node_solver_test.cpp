// The nodes of the tree can be solved in another way, by Eigen and without blocks, with the same solution.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "merge/tree/merge_in_memory.h"
#include "merge/tree/node.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

class EigenNodeSolver final : public NodeSolver {
 public:
  Front::Result eliminate(const PlanNode& node, UpdateMatrix left, UpdateMatrix right, double lambda) const override {
    ++eliminated;
    Front front(node.eliminated, node.separator, std::max(left.right_hand_sides, right.right_hand_sides));
    front.add(left);
    front.add(right);
    const Eigen::Index e = front.eliminated_dimension(), n = front.dimension(), p = n - e;
    const Eigen::Index sides = std::max(left.right_hand_sides, right.right_hand_sides);
    const Eigen::VectorXd diagonal = Eigen::Map<const Eigen::VectorXd>(front.diagonal(), n);
    const Eigen::MatrixXd columns = Eigen::Map<const Eigen::MatrixXd>(front.factor(), n, e);
    const Eigen::MatrixXd b = Eigen::Map<const Eigen::MatrixXd>(front.rhs(), n, sides);
    Eigen::MatrixXd inner = columns.topRows(e).selfadjointView<Eigen::Lower>();
    inner.diagonal() += lambda * diagonal.head(e);
    const Eigen::MatrixXd lower = inner.llt().matrixL();
    const auto solved = lower.triangularView<Eigen::Lower>();
    const Eigen::MatrixXd y = solved.solve(columns.bottomRows(p).transpose()).transpose();
    const Eigen::MatrixXd z = solved.solve(b.topRows(e));

    Front::Result result;
    result.factor = {node.eliminated, node.separator, sides, {}, {z.data(), z.data() + z.size()}, {}};
    Eigen::MatrixXd both(n, e);
    both << lower, y;
    result.factor.factor.assign(both.data(), both.data() + both.size());
    const Eigen::MatrixXd rest =
        Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd>(front.update(), p, p).selfadjointView<Eigen::Lower>()) -
        y * y.transpose();
    const Eigen::MatrixXd rhs = b.bottomRows(p) - y * z;
    result.update.unknowns = node.separator;
    result.update.right_hand_sides = sides;
    for (Eigen::Index j = 0; j < p; ++j)
      for (Eigen::Index i = j; i < p; ++i) result.update.matrix.push_back(rest(i, j));
    result.update.rhs.assign(rhs.data(), rhs.data() + rhs.size());
    result.update.diagonal.assign(diagonal.data() + e, diagonal.data() + n);
    result.update.sums = front.sums();
    result.update.sums.unknowns += e;
    if (e > 0) result.update.sums.decrement_squared += z.col(0).squaredNorm();
    return result;
  }
  Step back_substitute(const FrontFactor& factor, const Step& parent) const override {
    return dense_node_solver().back_substitute(factor, parent);
  }
  FrontCovariance covariance(const FrontFactor& factor, CovarianceMatrix separator) const override {
    return dense_node_solver().covariance(factor, std::move(separator));
  }
  mutable int eliminated = 0;
};

TEST(NodeSolver, AnotherOneLeadsToTheSameSolution) {
  SimulationOptions options;
  options.frames = 60;
  options.points_per_frame = 60;
  const TiledBlock block(simulate_block(options), 12, {}, 0.05);
  const EigenNodeSolver other;
  MergeInMemory dense(block.tiles.tree, block.problems, block.states);
  MergeInMemory by_eigen(block.tiles.tree, block.problems, block.states, {}, other);
  GlobalState first = start_global({}), second = start_global({});
  adjust_globally(dense, {}, first);
  adjust_globally(by_eigen, {}, second);
  ASSERT_EQ(second.outcome, GlobalOutcome::kConverged) << describe(second);
  EXPECT_EQ(first.iterations, second.iterations);
  EXPECT_GT(other.eliminated, 3 * second.iterations);
  EXPECT_NEAR(first.cost, second.cost, 1e-12 * first.cost);
  for (std::size_t t = 0; t < block.problems.size(); ++t)
    for (std::size_t f = 0; f < block.problems[t].frames.size(); ++f)
      EXPECT_LT((dense.states()[t].frames[f].centre - by_eigen.states()[t].frames[f].centre).norm(), 1e-9);
  dense.final_up();
  by_eigen.final_up();
  const auto expected = dense.covariances(), reached = by_eigen.covariances();
  for (std::size_t t = 0; t < expected.size(); ++t)
    for (std::size_t f = 0; f < expected[t].frames.size(); ++f)
      EXPECT_LT((expected[t].frames[f] - reached[t].frames[f]).norm(), 1e-6 * expected[t].frames[f].norm());
}

}  // namespace
}  // namespace megablock
