// Computes the covariances of a tile: from the top down through the fronts of its cells (front_covariance.cpp), then
// point by point. The front of a cell holds all unknowns in the residuals of its points, so it has all the C_ab below.
//
// The step of a point is x_p = C^-T (C^-1 b_p - sum_a Y_a'x_a), with Y_a = W_a C^-T and V = C C' (point_equations.h).
// Given the other unknowns, the point has the covariance V^-1, and this part of its error is independent of them. Hence
//
//     C_ap = -sum_b C_ab Y_b C^-1,    C_pp = C^-T (I + sum_a Y_a' sum_b C_ab Y_b) C^-1.
//
// A residual r (divided by sigma and weighted by its loss) with the Jacobians J_a by its unknowns, and J_p by its
// point, has the redundancy number 1 - v, where v is its diagonal element of
//
//     J C J' = J_p C_pp J_p' + 2 sum_a J_a C_ap J_p' + sum_ab J_a C_ab J_b'.
//
// The redundancy numbers of all observations add up to the degrees of freedom (io/block/observation_statistics.h). They
// do not depend on how a free datum is held, because a similarity changes no residual.
#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "adjust/terms/prior_loss.h"
#include "geometry/numbers/decompositions.h"
#include "merge/plan/tree_workers.h"
#include "merge/plan/unknowns.h"
#include "merge/tile/cluster_scores.h"
#include "merge/tile/condense.h"
#include "merge/tile/point_equations.h"
#include "merge/tile/position_covariances.h"

namespace megablock {

namespace {

ObservationKind image_kind(PointRole role) {
  return role == PointRole::kControl ? ObservationKind::kControlImage
         : role == PointRole::kCheck ? ObservationKind::kCheckImage
                                     : ObservationKind::kTieImage;
}

struct CellStatistics {
  ObservationTable observations;
  ImageSpread spread;
};

// The contributions of the cells that one thread works on. Each thread writes to places of its own.
class CellCovariances {
 public:
  // `offsets`: first row of each of plan.unknowns in `columns`.
  CellCovariances(const TileProblem& problem, const TilePlan& plan, const TileState& state, const PointTables& tables,
                  const Step& columns, const std::vector<std::int64_t>& offsets, const TileDatum& datum,
                  TileCovariance& result)
      : own_share_(datum.clusters == nullptr ? 1 : 1 - kScoreWeight),
        with_ties_(datum.clusters == nullptr),
        problem_(problem),
        plan_(plan),
        state_(state),
        columns_(columns),
        offsets_(offsets),
        result_(result),
        equations_(problem, state, tables),
        frame_sums_(plan.unknowns.size()),
        row_of_unknown_(plan.unknowns.size(), -1) {
    if (datum.spread > 0) images_.emplace(problem, plan, datum.spread);
  }

  // Adds the points and observations of a cell, from the covariance of its unknowns.
  void add(std::size_t cell, const CovarianceMatrix& covariance, CellStatistics& statistics) {
    observations_ = &statistics.observations;
    cell_ = covariance.matrix.data();
    const std::vector<std::int64_t> offsets = row_offsets(covariance.unknowns);
    cell_rows_ = offsets.back();
    for (std::size_t i = 0; i < covariance.unknowns.size(); ++i)
      row_of_unknown_[at(find_unknown(plan_.unknowns, covariance.unknowns[i].id))] = offsets[i];
    std::vector<std::int32_t> points = plan_.points[cell].rows();
    if (!with_ties_)
      std::erase_if(points, [this](std::int32_t p) { return problem_.points[at(p)].role == PointRole::kTie; });
    for (std::span<const std::int32_t> rest = points; !rest.empty();) {
      // The points are linearised without damping and without the curvature of the losses, as in the sweep that made
      // the factors.
      rest = rest.subspan(equations_.linearise(rest, 0));
      equations_.reduce(frame_sums_);
      for (std::size_t i = 0; i < equations_.points().size(); ++i) {
        equations_.blocks(i, blocks_);
        add_point(i);
        if (columns_.columns > 1) add_point_columns(i);
        if (images_) images_->add_point(equations_, i);
      }
    }
    if (images_)
      images_->finish([this](std::int64_t a, std::int64_t rows, std::int64_t b,
                             std::int64_t columns) -> Eigen::MatrixXd { return covariance_of(a, rows, b, columns); },
                      statistics.spread);
    visit_terms(problem_, plan_, state_, 0, cell, [&](const TermResidual& term) { add_term(term); });
  }

 private:
  using CovarianceBlock = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  // The covariance of two unknowns of the cell.
  CovarianceBlock covariance_of(std::int64_t a, std::int64_t rows, std::int64_t b, std::int64_t columns) const {
    const double* first = cell_ + row_of_unknown_[at(a)] + row_of_unknown_[at(b)] * cell_rows_;
    return {first, rows, columns, Eigen::OuterStride<>(cell_rows_)};
  }

  // C_ap of all unknowns a of the point, into with_point_, and C_pp.
  void add_point(std::size_t i) {
    const Eigen::Matrix3d inverse = equations_.inverse_factor(i);
    Eigen::Matrix3d inner = own_share_ * Eigen::Matrix3d::Identity();
    with_point_.resize(blocks_.size());
    for (std::size_t a = 0; a < blocks_.size(); ++a) {
      auto& sum = with_point_[a];
      sum.setZero(blocks_[a].dimension, 3);
      for (const auto& b : blocks_)
        sum.noalias() += covariance_of(blocks_[a].unknown, blocks_[a].dimension, b.unknown, b.dimension) * b.matrix();
      inner.noalias() += blocks_[a].matrix().transpose() * sum;
      sum = (-sum * inverse).eval();
    }
    const Eigen::Matrix3d covariance = inverse.transpose() * inner * inverse;
    const PointEquations::Point& point = equations_.points()[i];
    result_.points[at(point.point)] = covariance;
    add_image_redundancy(point, covariance);
    add_prior_redundancy(point.point, covariance);
  }

  void add_image_redundancy(const PointEquations::Point& point, const Eigen::Matrix3d& covariance) {
    ObservationStatistics& sums = (*observations_)[image_kind(problem_.points[at(point.point)].role)];
    for (std::int64_t lane = point.first; lane < point.last; ++lane) {
      const Eigen::Matrix<double, 2, 3> by_point = equations_.by_point(lane);
      const Eigen::Vector2d residual = equations_.residual(lane);
      const int count = equations_.jacobians(lane, jacobians_);
      // The diagonal of J C J', term by term as at the head. Only the two diagonal elements of each product are formed.
      Eigen::Vector2d variance = (by_point * covariance).cwiseProduct(by_point).rowwise().sum();
      for (int i = 0; i < count; ++i) {
        const auto& a = jacobians_[at(i)];
        const auto& with_point = with_point_[place(a.unknown)];
        variance += 2 * (a.jacobian * with_point).cwiseProduct(by_point).rowwise().sum();
        for (int j = 0; j < count; ++j) {
          const auto& b = jacobians_[at(j)];
          variance += (a.jacobian * covariance_of(a.unknown, a.jacobian.cols(), b.unknown, b.jacobian.cols()))
                          .cwiseProduct(b.jacobian)
                          .rowwise()
                          .sum();
        }
      }
      for (int k = 0; k < 2; ++k) sums.add(residual[k] * residual[k], 1 - variance[k]);
      const std::size_t row = at(equations_.row_of(lane));
      result_.redundancy_x[row] = static_cast<float>(1 - variance[0]);
      result_.redundancy_y[row] = static_cast<float>(1 - variance[1]);
    }
  }

  // The place in blocks_ of an unknown in the residuals of the present point.
  std::size_t place(std::int64_t unknown) const {
    std::size_t i = 0;
    while (blocks_[i].unknown != unknown) ++i;
    return i;
  }

  // The Jacobian of a prior is 1 / sigma on each axis. An axis of infinite sigma is no observation.
  void add_prior_redundancy(std::int64_t point, const Eigen::Matrix3d& covariance) {
    const std::int64_t row = equations_.prior_row(point);
    if (row < 0) return;
    const auto& term = problem_.point_priors[at(row)];
    const Eigen::Vector3d residual = point_prior_residual(state_.points[at(point)], term);
    const double weight = loss_of(problem_, term).evaluate(residual.squaredNorm())[1];
    for (int axis = 0; axis < 3; ++axis) {
      if (std::isinf(term.sigma[axis])) continue;
      const double variance = weight * covariance(axis, axis) / (term.sigma[axis] * term.sigma[axis]);
      (*observations_)[axis < 2 ? ObservationKind::kControlHorizontal : ObservationKind::kControlHeight].add(
          weight * residual[axis] * residual[axis], 1 - variance);
    }
  }

  void add_term(const TermResidual& term) {
    Eigen::VectorXd variance = Eigen::VectorXd::Zero(term.residual.size());
    for (int i = 0; i < term.block_count; ++i) {
      for (int j = 0; j < term.block_count; ++j) {
        const auto &a = term.blocks[at(i)], &b = term.blocks[at(j)];
        variance += (a.jacobian * covariance_of(a.unknown, a.jacobian.cols(), b.unknown, b.jacobian.cols()))
                        .cwiseProduct(b.jacobian)
                        .rowwise()
                        .sum();
      }
    }
    for (Eigen::Index k = 0; k < variance.size(); ++k)
      (*observations_)[term.kinds[at(k)]].add(term.residual[k] * term.residual[k], 1 - variance[k]);
  }

  // The further columns of a point. Their right-hand side at the point is zero: x_p = -C^-T sum Y_i' x_i.
  void add_point_columns(std::size_t i) {
    const std::int64_t n = offsets_.back();
    Eigen::Matrix<double, 3, Eigen::Dynamic> sum = Eigen::MatrixXd::Zero(3, columns_.columns - 1);
    for (const auto& block : blocks_) {
      const double* first = columns_.values.data() + offsets_[at(block.unknown)] + n;
      const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> x(first, block.dimension, columns_.columns - 1,
                                                                         Eigen::OuterStride<>(n));
      sum -= block.matrix().transpose() * x;
    }
    result_.point_columns[at(equations_.points()[i].point)] = equations_.inverse_factor(i).transpose() * sum;
  }

  // The own part of a point's covariance is in both C(0) and C(w). Its share w makes it part of the empirical one.
  const double own_share_;
  const bool with_ties_;  // whether the covariances and redundancy numbers of tie points are asked for
  const TileProblem& problem_;
  const TilePlan& plan_;
  const TileState& state_;
  const Step& columns_;
  const std::vector<std::int64_t>& offsets_;
  TileCovariance& result_;
  PointEquations equations_;
  std::optional<ImageClusters> images_;
  std::vector<FrameSum> frame_sums_;           // reduce() fills them together with Y; they are not used
  std::vector<PointEquations::Block> blocks_;  // of the present point
  // These belong to the present cell.
  ObservationTable* observations_ = nullptr;
  std::vector<std::int64_t> row_of_unknown_;  // row of each unknown in the covariance of the cell
  const double* cell_ = nullptr;              // the covariance of the cell's unknowns
  std::int64_t cell_rows_ = 0;
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, kMaxIntrinsics, 3>> with_point_;  // C_ap
  std::array<JacobianBlock<IntrinsicJacobian>, 3> jacobians_;  // of one observation
};

// Goes down the tree of the cells and collects the results of all threads.
class TileCovarianceBuilder {
 public:
  TileCovarianceBuilder(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                        const TileFactor& factor, const Step& columns, const TileDatum& datum)
      : plan_(plan),
        factor_(factor),
        offsets_(row_offsets(plan.unknowns)),
        positions_(problem, plan, state, result_),
        tables_(problem, plan, state),
        cells_([&, this] {
          return std::make_unique<CellCovariances>(problem, plan, state, tables_, columns, offsets_, datum, result_);
        }) {
    if (columns.columns > 1)
      result_.point_columns.assign(problem.points.size(), Eigen::MatrixXd::Zero(3, columns.columns - 1));
    result_.frames.assign(problem.frames.size(), Eigen::Matrix<double, 6, 6>::Zero());
    for (const Intrinsics& camera : state.cameras)
      result_.cameras.push_back(Eigen::MatrixXd::Zero(camera.size(), camera.size()));
    result_.mounts.assign(problem.mounts.size(), Eigen::Matrix<double, 6, 6>::Zero());
    result_.points.assign(problem.points.size(), Eigen::Matrix3d::Zero());
    // NaN stays where an observation takes no part.
    result_.redundancy_x.assign(problem.kept.size(), std::numeric_limits<float>::quiet_NaN());
    result_.redundancy_y = result_.redundancy_x;
    invert(plan.unknown_of_frame, frame_of_);
    invert(plan.unknown_of_camera, camera_of_);
    invert(plan.unknown_of_mount, mount_of_);
  }

  TileCovariance build(CovarianceMatrix boundary) {
    result_.boundary = std::move(boundary);
    take(result_.boundary, plan_.boundary);
    std::vector<CellStatistics> cells(plan_.points.size());
    // The whole covariance of a front (E and P) serves both of its children and is freed after them. A cell adds its
    // points as soon as its own is there.
    visit_parents_first<CovarianceMatrix>(plan_.cells.nodes, [&](std::int64_t n, const CovarianceMatrix* parent) {
      const PlanNode& node = plan_.cells.nodes[at(n)];
      const FrontFactor& factor = factor_.nodes[at(n)];
      const CovarianceMatrix& outer = parent ? *parent : result_.boundary;
      CovarianceMatrix covariance = covariance_down(factor, outer.restricted_to(factor.separator)).whole();
      take(covariance, node.eliminated);
      if (node.leaf >= 0) cells_.mine().add(at(node.leaf), covariance, cells[at(node.leaf)]);
      return covariance;
    });
    // The tables are added in the order of the cells, so that the bits do not depend on the threads.
    for (const CellStatistics& cell : cells) {
      result_.observations.add(cell.observations);
      result_.spread.add(cell.spread);
    }
    return std::move(result_);
  }

 private:
  // From the unknown of each row of a table to the row of each unknown.
  void invert(const std::vector<std::int64_t>& unknown_of_row, std::vector<std::int64_t>& row_of_unknown) {
    row_of_unknown.assign(plan_.unknowns.size(), -1);
    for (std::size_t row = 0; row < unknown_of_row.size(); ++row)
      if (unknown_of_row[row] >= 0) row_of_unknown[at(unknown_of_row[row])] = static_cast<std::int64_t>(row);
  }

  // Copies the diagonal blocks of the listed unknowns, and takes the positions that depend on them.
  void take(const CovarianceMatrix& covariance, const UnknownList& list) {
    positions_.take(covariance, list);
    for (const Unknown& u : list) {
      const std::int64_t unknown = find_unknown(plan_.unknowns, u.id);
      if (unknown < 0) continue;
      std::vector<double> block(at(u.dimension * u.dimension));
      covariance.block(u.id, u.id, block.data());
      switch (u.id.kind) {
        case UnknownKind::kFrame:
          result_.frames[at(frame_of_[at(unknown)])] = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(block.data());
          break;
        case UnknownKind::kMount:
          result_.mounts[at(mount_of_[at(unknown)])] = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(block.data());
          break;
        case UnknownKind::kCamera:
          take_camera(at(camera_of_[at(unknown)]), u.dimension, block);
          break;
      }
    }
  }

  // The rows of the update are those of the free parameters; the result has all parameters of the model.
  void take_camera(std::size_t camera, std::int64_t dimension, const std::vector<double>& block) {
    std::vector<int> parameters;
    for (int k = 0; k < result_.cameras[camera].cols(); ++k)
      if (contains(plan_.camera_free[camera], k)) parameters.push_back(k);
    for (std::size_t i = 0; i < parameters.size(); ++i)
      for (std::size_t j = 0; j < parameters.size(); ++j)
        result_.cameras[camera](parameters[i], parameters[j]) = block[i + j * at(dimension)];
  }

  const TilePlan& plan_;
  const TileFactor& factor_;
  std::vector<std::int64_t> offsets_;
  std::vector<std::int64_t> frame_of_, camera_of_, mount_of_;
  TileCovariance result_;
  PositionCovariances positions_;
  PointTables tables_;
  PerThread<CellCovariances> cells_;
};

}  // namespace

TileCovariance covariance_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const TileFactor& factor, CovarianceMatrix boundary, const TileDatum& datum,
                               const Step& columns) {
  if (factor.empty())
    return covariance_tile(problem, plan, state, condense_tile(problem, plan, state, 0, datum).factor,
                           std::move(boundary), datum, columns);
  return TileCovarianceBuilder(problem, plan, state, factor, columns, datum).build(std::move(boundary));
}

}  // namespace megablock
