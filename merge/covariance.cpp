// Covariances of a tile: down through the cells' fronts, then C_pp = V^-1 + V^-1 W' C_ff W V^-1 per point.
#include "merge/condense.h"
#include "merge/tile_linearisation.h"

namespace megablock {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

class TileCovarianceBuilder {
 public:
  TileCovarianceBuilder(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                        const TileFactor& factor, const Step& columns)
      : problem_(problem), plan_(plan), factor_(factor), columns_(columns), equations_(problem, plan, state) {
    offsets_ = row_offsets(plan.unknowns);
    if (columns.columns > 1)
      result_.point_columns.assign(problem.points.size(), Eigen::MatrixXd::Zero(3, columns.columns - 1));
    result_.frames.assign(problem.frames.size(), Eigen::Matrix<double, 6, 6>::Zero());
    for (const Intrinsics& camera : state.cameras)
      result_.cameras.push_back(Eigen::MatrixXd::Zero(camera.size(), camera.size()));
    result_.mounts.assign(problem.mounts.size(), Eigen::Matrix<double, 6, 6>::Zero());
    result_.points.assign(problem.points.size(), Eigen::Matrix3d::Zero());
    row_of_unknown_.assign(plan.unknowns.size(), -1);
    invert(plan.unknown_of_frame, frame_of_);
    invert(plan.unknown_of_camera, camera_of_);
    invert(plan.unknown_of_mount, mount_of_);
  }

  TileCovariance build(const CovarianceMatrix& boundary) {
    result_.boundary = boundary;
    take(boundary, plan_.boundary);
    descend(plan_.cells.root(), boundary);
    return std::move(result_);
  }

 private:
  void invert(const std::vector<std::int64_t>& unknown_of_row, std::vector<std::int64_t>& row_of_unknown) {
    row_of_unknown.assign(plan_.unknowns.size(), -1);
    for (std::size_t row = 0; row < unknown_of_row.size(); ++row)
      if (unknown_of_row[row] >= 0) row_of_unknown[at(unknown_of_row[row])] = static_cast<std::int64_t>(row);
  }

  void descend(std::int64_t number, const CovarianceMatrix& parent) {
    const PlanNode& node = plan_.cells.nodes[at(number)];
    const CovarianceMatrix covariance = covariance_down(factor_.nodes[at(number)], parent);
    take(covariance, node.eliminated);
    if (node.leaf >= 0) add_points(at(node.leaf), covariance);
    if (node.left >= 0) descend(node.left, covariance);
    if (node.right >= 0) descend(node.right, covariance);
  }

  // Copies the diagonal blocks of the listed unknowns.
  void take(const CovarianceMatrix& covariance, const UnknownList& list) {
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

  void take_camera(std::size_t camera, std::int64_t dimension, const std::vector<double>& block) {
    std::vector<int> parameters;
    for (int k = 0; k < result_.cameras[camera].cols(); ++k)
      if (contains(problem_.camera_free[camera], k)) parameters.push_back(k);
    for (std::size_t i = 0; i < parameters.size(); ++i)
      for (std::size_t j = 0; j < parameters.size(); ++j)
        result_.cameras[camera](parameters[i], parameters[j]) = block[i + j * at(dimension)];
  }

  void add_points(std::size_t cell, const CovarianceMatrix& covariance) {
    const std::vector<std::int64_t> offsets = row_offsets(covariance.unknowns);
    for (std::size_t i = 0; i < covariance.unknowns.size(); ++i)
      row_of_unknown_[at(find_unknown(plan_.unknowns, covariance.unknowns[i].id))] = offsets[i];
    const std::int64_t n = offsets.back();
    for (std::int64_t point : plan_.points[cell]) {
      equations_.linearise(point, 0);
      const auto& blocks = equations_.blocks();
      Eigen::Matrix3d inner = Eigen::Matrix3d::Identity();
      for (const auto& a : blocks) {
        for (const auto& b : blocks) {
          const double* first =
              covariance.matrix.data() + row_of_unknown_[at(a.unknown)] + row_of_unknown_[at(b.unknown)] * n;
          const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> block(first, a.dimension, b.dimension,
                                                                                 Eigen::OuterStride<>(n));
          inner += a.w.transpose() * block * b.w;
        }
      }
      if (columns_.columns > 1) add_point_columns(point);
      result_.points[at(point)] = equations_.inverse_factor().transpose() * inner * equations_.inverse_factor();
    }
  }

  // Their own right-hand side is zero: x_p = -C^-T sum Y_i' x_i.
  void add_point_columns(std::int64_t point) {
    const std::int64_t n = offsets_.back();
    Eigen::Matrix<double, 3, Eigen::Dynamic> sum = Eigen::MatrixXd::Zero(3, columns_.columns - 1);
    for (const auto& block : equations_.blocks()) {
      const double* first = columns_.values.data() + offsets_[at(block.unknown)] + n;
      const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> x(first, block.dimension, columns_.columns - 1,
                                                                         Eigen::OuterStride<>(n));
      sum -= block.w.transpose() * x;
    }
    result_.point_columns[at(point)] = equations_.inverse_factor().transpose() * sum;
  }

  const TileProblem& problem_;
  const TilePlan& plan_;
  const TileFactor& factor_;
  const Step& columns_;
  std::vector<std::int64_t> offsets_;
  PointEquations equations_;
  std::vector<std::int64_t> frame_of_, camera_of_, mount_of_, row_of_unknown_;
  TileCovariance result_;
};

}  // namespace

TileCovariance covariance_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const TileFactor& factor, const CovarianceMatrix& boundary, const TileDatum& datum,
                               const Step& columns) {
  if (factor.empty())
    return covariance_tile(problem, plan, state, condense_tile(problem, plan, state, 0, datum).factor, boundary, datum,
                           columns);
  return TileCovarianceBuilder(problem, plan, state, factor, columns).build(boundary);
}

}  // namespace megablock
