#include "merge/tile/cluster_scores.h"

#include <algorithm>
#include <cmath>

#include "merge/plan/unknowns.h"
#include "merge/tile/cell_assembler.h"

namespace megablock {

namespace {

constexpr double kLeverageUnits = 32;
constexpr double kFields = 12;  // along the longer side of an image
// A cluster whose unknowns follow its residuals nearly completely tells little; its score is not multiplied further.
constexpr double kMostShare = 0.8;

std::int64_t first_kept(const TileProblem& problem, std::int64_t point) {
  std::int64_t row = problem.begin[at(point)];
  while (!problem.kept[at(row)]) ++row;
  return row;
}

}  // namespace

ClusterWeights cluster_weights(const TileProblem& problem, const TileCovariance& covariance) {
  ClusterWeights weights{std::vector<std::uint8_t>(problem.points.size(), 0),
                         std::vector<double>(problem.cameras.size(), 1), covariance.concentration};
  for (std::size_t p = 0; p < problem.points.size(); ++p) {
    double sum = 0;
    bool any = false;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      const double x = covariance.redundancy_x[at(row)], y = covariance.redundancy_y[at(row)];
      if (!problem.kept[at(row)] || !std::isfinite(x) || !std::isfinite(y)) continue;
      any = true;
      sum += 2 - x - y;
      double& extent = weights.extents[at(problem.images[at(problem.image[at(row)].value)].camera.value)];
      extent = std::max({extent, problem.x[at(row)], problem.y[at(row)]});
    }
    // The point itself takes three.
    if (any)
      weights.leverages[p] = static_cast<std::uint8_t>(std::lround(std::clamp((sum - 3) * kLeverageUnits, 0.0, 255.0)));
  }
  return weights;
}

ClusterScores::ClusterScores(const TileProblem& problem, const TilePlan& plan, const ClusterWeights& weights,
                             Front& front)
    : problem_(problem), plan_(plan), weights_(weights), front_(front) {
  for (const Unknown& u : plan.unknowns) rows_.push_back(front.row_of(u.id));
}

ClusterScores::Cluster& ClusterScores::cluster_of(std::int64_t point) {
  const std::int64_t row = first_kept(problem_, point);
  const LocalImage image = problem_.image[at(row)];
  const TileImage& seen = problem_.images[at(image.value)];
  const double field = weights_.extents[at(seen.camera.value)] / kFields;
  const auto along = [&](double pixel) { return static_cast<std::int32_t>(std::floor(pixel / field)) & 0x7fff; };
  Cluster& cluster = clusters_[{image.value, along(problem_.x[at(row)]) | along(problem_.y[at(row)]) << 15}];
  if (cluster.column < 0) {
    cluster.column = std::ssize(scores_);
    scores_.push_back(Eigen::VectorXd::Zero(front_.dimension()));
  }
  return cluster;
}

void ClusterScores::add_points(const PointEquations& equations) {
  std::array<JacobianBlock<IntrinsicJacobian>, 3> jacobians;
  for (std::size_t i = 0; i < equations.points().size(); ++i) {
    const PointEquations::Point& point = equations.points()[i];
    if (problem_.points[at(point.point)].role != PointRole::kTie) {
      add_formal(equations, i);
      continue;
    }
    Cluster& cluster = cluster_of(point.point);
    Eigen::VectorXd& score = scores_[at(cluster.column)];
    cluster.leverage += weights_.leverages[at(point.point)] / kLeverageUnits;
    cluster.rank += 2 * point.observation_count() - 3;
    ++cluster.points;
    for (std::int64_t lane = point.first; lane < point.last; ++lane) {
      const Eigen::Vector2d residual = equations.residual(lane);
      const int count = equations.jacobians(lane, jacobians);
      for (int k = 0; k < count; ++k) {
        const auto& block = jacobians[at(k)];
        score.segment(rows_[at(block.unknown)], block.jacobian.cols()) -= block.jacobian.transpose() * residual;
      }
    }
    equations.blocks(i, blocks_);
    for (const PointEquations::Block& block : blocks_)
      score.segment(rows_[at(block.unknown)], block.dimension) -= block.matrix() * equations.z(i);
  }
}

// The reduced normal equations of the point, J'J - Y Y'.
void ClusterScores::add_formal(const PointEquations& equations, std::size_t i) {
  const PointEquations::Point& point = equations.points()[i];
  std::array<JacobianBlock<IntrinsicJacobian>, 3> jacobians;
  const auto add = [&](std::int64_t a, std::int64_t b, const Eigen::MatrixXd& block) {
    if (rows_[at(a)] >= rows_[at(b)]) add_block(front_, rows_[at(a)], rows_[at(b)], kScoreWeight * block);
  };
  for (std::int64_t lane = point.first; lane < point.last; ++lane) {
    const int count = equations.jacobians(lane, jacobians);
    for (int a = 0; a < count; ++a)
      for (int b = 0; b < count; ++b)
        add(jacobians[at(a)].unknown, jacobians[at(b)].unknown,
            jacobians[at(a)].jacobian.transpose() * jacobians[at(b)].jacobian);
  }
  // The list has a frame once for each of its groups, so that pairs of equal frames come twice.
  equations.blocks(i, blocks_);
  for (const PointEquations::Block& a : blocks_)
    for (const PointEquations::Block& b : blocks_) add(a.unknown, b.unknown, -a.matrix() * b.matrix().transpose());
}

TermResidual ClusterScores::with_formal(TermResidual term) {
  for (int b = 0; b < term.block_count; ++b) term.blocks[at(b)].jacobian *= std::sqrt(1 + kScoreWeight);
  return term;
}

void ClusterScores::finish() {
  const std::int64_t n = front_.dimension(), count = std::ssize(scores_);
  if (count == 0) return;
  Eigen::MatrixXd scores(n, count);
  for (auto& [key, cluster] : clusters_) {
    const double rank = static_cast<double>(cluster.rank) / static_cast<double>(cluster.points);
    const double share = std::min(kMostShare, weights_.concentration * cluster.leverage / std::max(1.0, rank));
    scores.col(cluster.column) = scores_[at(cluster.column)] * std::sqrt(kScoreWeight / (1 - share));
  }
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(n, n);
  squares.selfadjointView<Eigen::Lower>().rankUpdate(scores);
  for (std::int64_t column = 0; column < n; ++column)
    for (std::int64_t row = column; row < n; ++row) *front_.place(row, column).values += squares(row, column);
}

}  // namespace megablock
