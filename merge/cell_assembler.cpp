#include "merge/cell_assembler.h"

namespace megablock {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

// C -= A B' with three columns each; leading dimensions n, lda, ldb. Numbers of rows known when compiling, or 0.
template <int kRows, int kColumns>
void subtract_product(double* c, std::int64_t n, const double* a, std::int64_t lda, const double* b, std::int64_t ldb,
                      std::int64_t rows = kRows, std::int64_t columns = kColumns) {
  const double *a0 = a, *a1 = a + lda, *a2 = a1 + lda;
  const std::int64_t height = kRows > 0 ? kRows : rows, width = kColumns > 0 ? kColumns : columns;
  for (std::int64_t j = 0; j < width; ++j) {
    const double b0 = b[j], b1 = b[j + ldb], b2 = b[j + 2 * ldb];
    double* __restrict__ column = c + j * n;
    for (std::int64_t i = 0; i < height; ++i) column[i] -= a0[i] * b0 + a1[i] * b1 + a2[i] * b2;
  }
}

// Frames and mounts have 6 unknowns, Brown's cameras 8.
void subtract_product(double* c, std::int64_t n, const double* a, std::int64_t lda, std::int64_t rows, const double* b,
                      std::int64_t ldb, std::int64_t columns) {
  if (rows == 6 && columns == 6) return subtract_product<6, 6>(c, n, a, lda, b, ldb);
  if (rows == 8 && columns == 6) return subtract_product<8, 6>(c, n, a, lda, b, ldb);
  if (rows == 6 && columns == 8) return subtract_product<6, 8>(c, n, a, lda, b, ldb);
  if (rows == 8 && columns == 8) return subtract_product<8, 8>(c, n, a, lda, b, ldb);
  subtract_product<0, 0>(c, n, a, lda, b, ldb, rows, columns);
}

}  // namespace

void add_block(double* matrix, std::int64_t n, std::int64_t row, std::int64_t column,
               const Eigen::Ref<const Eigen::MatrixXd>& block) {
  for (Eigen::Index j = 0; j < block.cols(); ++j)
    for (Eigen::Index i = row == column ? j : 0; i < block.rows(); ++i) {
      const std::int64_t r = row + i, c = column + j;
      matrix[std::max(r, c) + std::min(r, c) * n] += block(i, j);
    }
}

CellAssembler::CellAssembler(const TilePlan& plan, Front& front)
    : plan_(plan), front_(front), frames_(plan.unknowns.size()) {
  rows_.reserve(plan.unknowns.size());
  for (const Unknown& u : plan.unknowns) rows_.push_back(front.row_of(u.id));
}

void CellAssembler::add_point(const PointEquations& point) {
  add_frames(point);
  add_shared(point);
  const auto blocks = point.blocks();
  for (std::size_t i = 0; i < blocks.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j) subtract(blocks[i], blocks[j]);
  SubtreeSums& sums = front_.sums();
  sums.cost += 0.5 * point.rho();
  sums.weighted_squares += point.weighted_squares();
  sums.decrement_squared += point.z().squaredNorm();
  sums.residuals += point.residual_count();
  sums.observations += point.observation_count();
  sums.points += 1;
  sums.unknowns += 3;
  sums.held_points += point.held();
}

void CellAssembler::add_frames(const PointEquations& point) {
  const auto frames = point.frames();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    FrameSum& sum = frames_[at(frames[i].unknown)];
    const Eigen::Matrix<double, 6, 3> w = frames[i].coupling(frames[i].v), g = -frames[i].by_frame();
    subtract_product<6, 6>(sum.normal.data(), 6, w.data(), 6, g.data(), 6);
    sum.rhs.noalias() -= g * frames[i].b + point.blocks()[i].matrix() * point.z();
  }
}

void CellAssembler::add_shared(const PointEquations& point) {
  const std::int64_t n = front_.dimension();
  for (const PointEquations::Observation& o : point.observations()) {
    if (o.shared == nullptr) continue;
    const ImageUnknowns& u = point.unknowns_of(o);
    if (at(u.calibration) >= shared_.size()) shared_.resize(at(u.calibration + 1));
    SharedSum& sum = shared_[at(u.calibration)];
    const int width = u.shared_width;
    if (sum.normal.empty()) {
      sum.unknowns = u;
      sum.normal.assign(at(width * (width + 1)), 0);
    }
    const double *first = o.shared, *second = o.shared + width;
    for (int j = 0; j <= width; ++j) {
      const double a = j < width ? first[j] : o.residual[0], b = j < width ? second[j] : o.residual[1];
      double* __restrict__ column = sum.normal.data() + j * width;
      for (int i = j < width ? j & ~3 : 0; i < width; ++i) column[i] += first[i] * a + second[i] * b;
    }
    // J_s'J_f = W_sk G
    const PointEquations::FramePart& frame = point.frames()[at(o.frame)];
    const Eigen::Matrix<double, 6, 3> g = -frame.by_frame();
    const std::int64_t frame_row = rows_[at(frame.unknown)];
    const auto add = [&](std::int64_t unknown, const double* w, int dimension) {
      const std::int64_t row = rows_[at(unknown)];
      if (row >= frame_row)
        subtract_product(front_.matrix() + row + frame_row * n, n, w, width, dimension, g.data(), 6, 6);
      else
        subtract_product(front_.matrix() + frame_row + row * n, n, g.data(), 6, 6, w, width, dimension);
    };
    if (u.camera >= 0) add(u.camera, o.shared_point, u.camera_width);
    if (u.mount >= 0) add(u.mount, o.shared_point + u.camera_width, 6);
  }
  for (const auto& block : point.blocks().subspan(point.frames().size()))
    Eigen::Map<Eigen::VectorXd>(front_.rhs() + rows_[at(block.unknown)], block.dimension).noalias() -=
        block.matrix() * point.z();
}

void CellAssembler::subtract(const PointEquations::Block& a, const PointEquations::Block& b) {
  const std::int64_t n = front_.dimension(), row = rows_[at(a.unknown)], column = rows_[at(b.unknown)];
  if (row >= column)
    subtract_product(front_.matrix() + row + column * n, n, a.y, a.dimension, a.dimension, b.y, b.dimension,
                     b.dimension);
  else
    subtract_product(front_.matrix() + column + row * n, n, b.y, b.dimension, b.dimension, a.y, a.dimension,
                     a.dimension);
}

void CellAssembler::add_term(const TermResidual& term) {
  for (int a = 0; a < term.block_count; ++a) {
    const auto& block = term.blocks[at(a)];
    const std::int64_t row = rows_[at(block.unknown)];
    const Eigen::Index dimension = block.jacobian.cols();
    for (int b = 0; b < a; ++b)
      add_block(front_.matrix(), front_.dimension(), row, rows_[at(term.blocks[at(b)].unknown)],
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
  add_block(front_.matrix(), front_.dimension(), row, row, normal);
  Eigen::Map<Eigen::VectorXd>(front_.diagonal() + row, normal.cols()) += normal.diagonal();
}

void CellAssembler::finish(std::vector<double>& diagonal) {
  for (std::size_t u = 0; u < frames_.size(); ++u) {
    if (rows_[u] < 0 || plan_.unknowns[u].id.kind != UnknownKind::kFrame) continue;
    add_normal(static_cast<std::int64_t>(u), Eigen::Map<const Eigen::Matrix<double, 6, 6>>(frames_[u].normal.data()));
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(front_.rhs() + rows_[u]) += frames_[u].rhs;
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
      add_block(front_.matrix(), front_.dimension(), rows_[at(u.mount)], rows_[at(u.camera)],
                normal.block(camera, 0, mount, camera));
  }
  std::size_t offset = 0;
  for (std::size_t u = 0; u < rows_.size(); ++u) {
    for (std::int64_t k = 0; k < plan_.unknowns[u].dimension; ++k, ++offset)
      if (rows_[u] >= 0) diagonal[offset] += front_.diagonal()[rows_[u] + k];
  }
}

}  // namespace megablock
