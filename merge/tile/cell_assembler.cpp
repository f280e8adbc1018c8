#include "merge/tile/cell_assembler.h"

#include <algorithm>

#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

// Adds J'J to the lower triangle of C [width x (width + 1)], and J'r to its last column, for the two residuals of an
// observation. J is stored row by row. The column of r is treated as one more column of J.
void add_squares(double* c, std::int64_t width, const double* jacobian, const double* residual) {
  const double *first = jacobian, *second = jacobian + width;
  for (std::int64_t j = 0; j <= width; ++j) {
    const double a = j < width ? first[j] : residual[0], b = j < width ? second[j] : residual[1];
    double* __restrict__ column = c + j * width;
    for (std::int64_t i = j < width ? j : 0; i < width; ++i) column[i] += first[i] * a + second[i] * b;
  }
}

}  // namespace

void add_block(Front& front, std::int64_t row, std::int64_t column, const Eigen::Ref<const Eigen::MatrixXd>& block) {
  const bool below = row >= column;
  const Front::Place place = below ? front.place(row, column) : front.place(column, row);
  for (Eigen::Index j = 0; j < block.cols(); ++j)
    for (Eigen::Index i = row == column ? j : 0; i < block.rows(); ++i)
      place.values[below ? i + j * place.stride : j + i * place.stride] += block(i, j);
}

CellAssembler::CellAssembler(const TilePlan& plan, Front& front, PairBlocks& pair_blocks)
    : plan_(plan),
      front_(front),
      frames_(plan.unknowns.size()),
      numbers_(plan.unknowns.size(), -1),
      pair_blocks_(pair_blocks) {
  rows_.reserve(plan.unknowns.size());
  // Frames are numbered in the order of their rows in the front. The block of a pair i > j is then below the diagonal
  // of the front, as it stands in PairBlocks.
  for (const Unknown& u : plan.unknowns) {
    rows_.push_back(front.row_of(u.id));
    if (rows_.back() >= 0 && u.id.kind == UnknownKind::kFrame) frame_rows_.push_back(rows_.back());
  }
  std::ranges::sort(frame_rows_);
  for (std::size_t u = 0; u < rows_.size(); ++u)
    if (rows_[u] >= 0 && plan.unknowns[u].id.kind == UnknownKind::kFrame)
      numbers_[u] = std::ranges::lower_bound(frame_rows_, rows_[u]) - frame_rows_.begin();
  pair_blocks_.reserve(std::ssize(frame_rows_));
}

// `equations` has the present batch of points. Only pairs of frames and shared unknowns remain to be done here after
// reduce(), which has already summed what concerns one frame.
void CellAssembler::add_points(PointEquations& equations) {
  equations.reduce(frames_);
  const std::vector<PointEquations::Point>& points = equations.points();
  const std::int64_t groups = equations.group_count();
  group_frames_.resize(at(groups));
  for (std::int64_t group = 0; group < groups; ++group)
    group_frames_[at(group)] = numbers_[at(equations.frame_of(group))];
  equations.kernels().subtract_pairs(std::ssize(points), equations.begin(), equations.y(0), group_frames_.data(),
                                     pair_blocks_.pairs());
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i].shared_end > points[i].shared_begin) add_shared(equations, i);
  add_sums(equations);
}

// The sums of the points in their order, on which the bits of the cost depend.
void CellAssembler::add_sums(const PointEquations& equations) {
  const std::vector<PointEquations::Point>& points = equations.points();
  SubtreeSums& sums = front_.sums();
  double cost = sums.cost, weighted_squares = sums.weighted_squares, decrement_squared = sums.decrement_squared;
  for (std::size_t i = 0; i < points.size(); ++i) {
    cost += 0.5 * points[i].rho;
    weighted_squares += points[i].weighted_squares;
    decrement_squared += equations.z(i).squaredNorm();
    sums.residuals += points[i].residual_count;
    sums.held_points += equations.held(i);
  }
  sums.cost = cost;
  sums.weighted_squares = weighted_squares;
  sums.decrement_squared = decrement_squared;
  sums.observations += points.back().last;
  sums.points += std::ssize(points);
  sums.unknowns += 3 * std::ssize(points);
}

// Adds what the shared unknowns s of a point contribute: J_s'J_s and J_s'r (summed by camera and mount until finish()),
// J_s'J_f = sum W_sk G, and -Y_s Y_i' for every unknown i of the point, frames included. The last two go to the front
// point by point.
void CellAssembler::add_shared(const PointEquations& equations, std::size_t i) {
  const PointEquations::Point& point = equations.points()[i];
  const point_kernels::Kernels& kernels = equations.kernels();
  for (std::int64_t lane = point.first; lane < point.last; ++lane) {
    const ImageUnknowns& u = equations.unknowns_of(lane);
    const int width = u.shared_width;
    if (width == 0) continue;
    if (at(u.calibration) >= shared_.size()) shared_.resize(at(u.calibration + 1));
    SharedSum& sum = shared_[at(u.calibration)];
    if (sum.normal.empty()) {
      sum.unknowns = u;
      sum.normal.assign(at(width * (width + 1)), 0);
    }
    const PointEquations::SharedRows& shared = equations.shared(lane);
    add_squares(sum.normal.data(), width, shared.jacobian, equations.residual(lane).data());
    // J_s'J_f = W_sk G
    Eigen::Matrix<double, 6, 3> minus_g;
    minus_g << -skew<double>(equations.from_frame(lane)), Eigen::Matrix3d::Identity();
    const Factor frame{u.frame, 6, 6, minus_g.data()};
    if (u.camera >= 0) subtract_outer(kernels, {u.camera, u.camera_width, width, shared.by_point}, frame);
    if (u.mount >= 0) subtract_outer(kernels, {u.mount, 6, width, shared.by_point + u.camera_width}, frame);
  }
  // The frames come first in the list. Pairs of frames are done already, so b begins behind them.
  equations.blocks(i, blocks_);
  for (std::size_t b = at(point.group_count()); b < blocks_.size(); ++b) {
    const PointEquations::Block& block = blocks_[b];
    for (std::size_t a = 0; a <= b; ++a)
      subtract_outer(kernels, {block.unknown, block.dimension, block.dimension, block.y},
                     {blocks_[a].unknown, blocks_[a].dimension, blocks_[a].dimension, blocks_[a].y});
    Eigen::Map<Eigen::VectorXd>(front_.rhs() + rows_[at(block.unknown)], block.dimension).noalias() -=
        block.matrix() * equations.z(i);
  }
}

// The factor of the lower row block goes to the left, because only the lower triangle of the front is used.
void CellAssembler::subtract_outer(const point_kernels::Kernels& kernels, const Factor& a, const Factor& b) {
  const std::int64_t row = rows_[at(a.unknown)], column = rows_[at(b.unknown)];
  const bool below = row >= column;
  const Factor &left = below ? a : b, &right = below ? b : a;
  const Front::Place place = front_.place(std::max(row, column), std::min(row, column));
  kernels.subtract_product(place.values, place.stride, left.values, left.stride, left.rows, right.values, right.stride,
                           right.rows);
}

// K_ab += J_a'J_b and b_a -= J_a'r for all pairs of unknowns of the observation; each pair is visited once.
void CellAssembler::add_term(const TermResidual& term) {
  for (int a = 0; a < term.block_count; ++a) {
    const auto& block = term.blocks[at(a)];
    const std::int64_t row = rows_[at(block.unknown)];
    const Eigen::Index dimension = block.jacobian.cols();
    for (int b = 0; b < a; ++b)
      add_block(front_, row, rows_[at(term.blocks[at(b)].unknown)],
                block.jacobian.transpose().lazyProduct(term.blocks[at(b)].jacobian));
    add_normal(block.unknown, block.jacobian.transpose().lazyProduct(block.jacobian));
    Eigen::Map<Eigen::VectorXd>(front_.rhs() + row, dimension) -= block.jacobian.transpose() * term.residual;
  }
  SubtreeSums& sums = front_.sums();
  sums.cost += 0.5 * term.rho;
  sums.weighted_squares += term.weighted_squares;
  sums.residuals += term.residual.size();
}

void CellAssembler::add_normal(std::int64_t unknown, const Eigen::Ref<const Eigen::MatrixXd>& normal) {
  const std::int64_t row = rows_[at(unknown)];
  add_block(front_, row, row, normal);
  Eigen::Map<Eigen::VectorXd>(front_.diagonal() + row, normal.cols()) += normal.diagonal();
}

// K_ij -= sum Y_i Y_j' of all points of the cell, in one go for each pair.
void CellAssembler::add_pairs() {
  pair_blocks_.take(std::ssize(frame_rows_), [&](std::int64_t i, std::int64_t j, const double* block) {
    const Front::Place place = front_.place(frame_rows_[at(i)], frame_rows_[at(j)]);
    for (int column = 0; column < 6; ++column)
      for (int row = 0; row < 6; ++row)
        place.values[row + column * place.stride] += block[row + column * point_kernels::kPairStride];
  });
}

void CellAssembler::finish(std::vector<double>& diagonal) {
  add_pairs();
  for (std::size_t u = 0; u < frames_.size(); ++u) {
    if (rows_[u] < 0 || plan_.unknowns[u].id.kind != UnknownKind::kFrame) continue;
    const double* sum = frames_[u].values.data();
    // The 6 x 6 block of the frame, G'RG, from the sums of its 3 x 3 blocks (cell_assembler.h).
    const auto symmetric = [](const double* lower) {
      Eigen::Matrix3d m;
      m << lower[0], lower[1], lower[3], lower[1], lower[2], lower[4], lower[3], lower[4], lower[5];
      return m;
    };
    const double* m = sum + point_kernels::kMixed;
    Eigen::Matrix3d mixed;
    // The trace of [u]x R is 0, since R is symmetric, and so it is of the sum. The last element follows from it.
    mixed << m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], -m[0] - m[4];
    Eigen::Matrix<double, 6, 6> normal;
    normal << symmetric(sum + point_kernels::kByRotation), -mixed, -mixed.transpose(),
        symmetric(sum + point_kernels::kByCentre);
    add_block(front_, rows_[u], rows_[u], normal);
    for (int k = 0; k < 6; ++k) {
      front_.diagonal()[rows_[u] + k] += sum[point_kernels::kDiagonal + k];
      front_.rhs()[rows_[u] + k] += sum[point_kernels::kRightHandSide + k];
    }
  }
  for (const SharedSum& sum : shared_) {
    if (sum.normal.empty()) continue;
    const ImageUnknowns& u = sum.unknowns;
    const Eigen::Index width = u.shared_width, camera = u.camera_width, mount = width - camera;
    const Eigen::Map<const Eigen::MatrixXd> normal(sum.normal.data(), width, width + 1);
    const auto add = [&](std::int64_t unknown, Eigen::Index first, Eigen::Index count) {
      if (unknown < 0) return;
      add_normal(unknown, normal.block(first, first, count, count));
      Eigen::Map<Eigen::VectorXd>(front_.rhs() + rows_[at(unknown)], count) -= normal.col(width).segment(first, count);
    };
    add(u.camera, 0, camera);
    add(u.mount, camera, mount);
    if (u.camera >= 0 && u.mount >= 0)
      add_block(front_, rows_[at(u.mount)], rows_[at(u.camera)], normal.block(camera, 0, mount, camera));
  }
  // Before any elimination in the front, its diagonal is that of the cell's own residuals.
  std::size_t offset = 0;
  for (std::size_t u = 0; u < rows_.size(); ++u) {
    for (std::int64_t k = 0; k < plan_.unknowns[u].dimension; ++k, ++offset)
      if (rows_[u] >= 0) diagonal[offset] += front_.diagonal()[rows_[u] + k];
  }
}

}  // namespace megablock
