#include "merge/condense.h"

#include <algorithm>

#include "geometry/decompositions.h"
#include "merge/tile_linearisation.h"

namespace megablock {

namespace {

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

// Scalar rows of TilePlan::unknowns in a front (first row of each, -1: not in it).
std::vector<std::int64_t> front_rows(const TilePlan& plan, const Front& front) {
  std::vector<std::int64_t> rows;
  rows.reserve(plan.unknowns.size());
  for (const Unknown& u : plan.unknowns) rows.push_back(front.row_of(u.id));
  return rows;
}

// Adds A'B (sign * ) at (row, column) of the lower triangle, transposed when it would lie above.
template <typename Product>
void add_product(double* matrix, std::int64_t n, std::int64_t row, std::int64_t column, const Product& product,
                 double sign) {
  const auto rows = product.rows(), columns = product.cols();
  if (row >= column) {
    for (Eigen::Index j = 0; j < columns; ++j)
      for (Eigen::Index i = 0; i < rows; ++i) matrix[row + i + (column + j) * n] += sign * product(i, j);
  } else {
    for (Eigen::Index i = 0; i < rows; ++i)
      for (Eigen::Index j = 0; j < columns; ++j) matrix[column + j + (row + i) * n] += sign * product(i, j);
  }
}

// Fills the front of a cell with its points (eliminated on the way) and its other observations.
class CellAssembler {
 public:
  CellAssembler(const TilePlan& plan, Front& front) : front_(front), rows_(front_rows(plan, front)) {}

  void add_point(const PointEquations& point) {
    const std::int64_t n = front_.dimension();
    for (const auto& observation : point.observations())
      add_residual(observation.blocks.data(), observation.block_count, observation.residual);
    const auto& blocks = point.blocks();
    double* matrix = front_.matrix();
    double* rhs = front_.rhs();
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const std::int64_t row = rows_[at(blocks[i].unknown)];
      for (std::size_t j = 0; j <= i; ++j)
        subtract_outer(matrix, n, row, rows_[at(blocks[j].unknown)], blocks[i], blocks[j]);
      const auto reduced = (blocks[i].w * point.z()).eval();
      for (Eigen::Index k = 0; k < reduced.size(); ++k) rhs[row + k] -= reduced[k];
    }
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

  void add_term(const TermResidual& term) {
    add_residual(term.blocks.data(), term.block_count, term.residual);
    SubtreeSums& sums = front_.sums();
    sums.cost += 0.5 * term.rho;
    sums.weighted_squares += term.weighted_squares;
    sums.residuals += term.residual.size();
  }

 private:
  using Product =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxIntrinsics, kMaxIntrinsics>;

  template <typename Jacobian, typename Residual>
  void add_residual(const JacobianBlock<Jacobian>* blocks, int count, const Residual& residual) {
    const std::int64_t n = front_.dimension();
    for (int a = 0; a < count; ++a) {
      const auto& jacobian = blocks[a].jacobian;
      const std::int64_t row = rows_[at(blocks[a].unknown)];
      const Eigen::Index dimension = jacobian.cols();
      double* rhs = front_.rhs();
      double* diagonal = front_.diagonal();
      for (Eigen::Index k = 0; k < dimension; ++k) {
        rhs[row + k] -= jacobian.col(k).dot(residual);
        diagonal[row + k] += jacobian.col(k).squaredNorm();
      }
      for (int b = 0; b <= a; ++b) {
        const Product product = jacobian.transpose().lazyProduct(blocks[b].jacobian);
        add_product(front_.matrix(), n, row, rows_[at(blocks[b].unknown)], product, 1);
      }
    }
  }

  static void subtract_outer(double* matrix, std::int64_t n, std::int64_t row, std::int64_t column,
                             const PointEquations::Block& a, const PointEquations::Block& b) {
    if (a.dimension == 6 && b.dimension == 6) {
      const Eigen::Matrix<double, 6, 3> left = a.w, right = b.w;
      const Eigen::Matrix<double, 6, 6> product = left * right.transpose();
      add_product(matrix, n, row, column, product, -1);
    } else {
      const Product product = a.w.lazyProduct(b.w.transpose());
      add_product(matrix, n, row, column, product, -1);
    }
  }

  Front& front_;
  std::vector<std::int64_t> rows_;
};

Front fill_cell(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                const PlanNode& node, PointEquations& equations, std::int64_t right_hand_sides) {
  Front front(node.eliminated, node.passed, right_hand_sides);
  CellAssembler assembler(plan, front);
  for (std::int64_t point : plan.points[at(node.leaf)]) {
    equations.linearise(point, pass);
    assembler.add_point(equations);
  }
  visit_terms(problem, plan, state, pass, at(node.leaf), [&](const TermResidual& term) { assembler.add_term(term); });
  return front;
}

// The datum enters where its unknown completes, or at the tile's top, where the diagonal is that of the whole tile.
void add_datum(const TileDatum& datum, const UnknownList& unknowns, Front& front) {
  for (const Unknown& u : unknowns) {
    const std::int64_t row = front.row_of(u.id);
    for (std::int64_t c = 0; c < datum.columns.columns; ++c) {
      const double* values = datum.columns.find(u.id, c);
      if (values == nullptr) continue;
      for (std::int64_t k = 0; k < u.dimension; ++k) front.rhs()[row + k + (c + 1) * front.dimension()] += values[k];
    }
    for (const TileDatum::Hold& hold : datum.holds) {
      if (hold.frame != u.id) continue;
      const Eigen::Matrix<double, 6, 1> root =
          Eigen::Map<const Eigen::Matrix<double, 6, 1>>(front.diagonal() + row).cwiseSqrt();
      const Eigen::MatrixXd scaled = root.asDiagonal() * hold.directions;
      const Eigen::MatrixXd basis = orthonormal_basis(scaled);
      const Eigen::MatrixXd weight = root.asDiagonal() * (basis * basis.transpose()) * root.asDiagonal();
      add_product(front.matrix(), front.dimension(), row, row, weight, 1);
    }
  }
}

// Squared steps times the diagonal of J'J, over the residuals of a tile.
class DampingNorm {
 public:
  explicit DampingNorm(const TilePlan& plan) : offsets_(row_offsets(plan.unknowns)) {
    diagonal_.assign(at(offsets_.back()), 0);
  }
  template <typename Jacobian>
  void add(const JacobianBlock<Jacobian>& block) {
    double* target = diagonal_.data() + offsets_[at(block.unknown)];
    for (Eigen::Index k = 0; k < block.jacobian.cols(); ++k) target[k] += block.jacobian.col(k).squaredNorm();
  }
  double norm(const Step& step) const {
    double sum = 0;
    for (std::size_t i = 0; i < diagonal_.size(); ++i) sum += diagonal_[i] * step.values[i] * step.values[i];
    return sum;
  }

 private:
  std::vector<std::int64_t> offsets_;
  std::vector<double> diagonal_;
};

}  // namespace

std::int64_t TileFactor::byte_count() const {
  std::int64_t sum = 0;
  for (const FrontFactor& node : nodes) sum += node.byte_count();
  return sum;
}

Bytes TileFactor::to_bytes() const {
  ByteWriter out;
  out.value<std::uint64_t>(nodes.size());
  for (const FrontFactor& node : nodes) node.write(out);
  return out.take();
}

TileFactor TileFactor::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  TileFactor factor;
  const auto count = in.value<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) factor.nodes.push_back(FrontFactor::read(in));
  if (!in.at_end()) throw StoreError("merge: a tile's factor has the wrong size");
  return factor;
}

TileCondensation condense_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const Pass& pass, const TileDatum& datum) {
  const std::int64_t right_hand_sides = 1 + datum.columns.columns;
  const std::vector<PlanNode>& nodes = plan.cells.nodes;
  PointEquations equations(problem, plan, state);
  std::vector<UpdateMatrix> updates(nodes.size());
  TileCondensation result;
  result.factor.nodes.resize(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const PlanNode& node = nodes[i];
    Front front = node.leaf >= 0 ? fill_cell(problem, plan, state, pass, node, equations, right_hand_sides)
                                 : Front(node.eliminated, node.passed, right_hand_sides);
    for (std::int64_t child : {node.left, node.right}) {
      if (child < 0) continue;
      front.add(updates[at(child)]);
      updates[at(child)] = UpdateMatrix();
    }
    add_datum(datum, node.eliminated, front);
    if (i + 1 == nodes.size()) add_datum(datum, node.passed, front);
    Front::Result eliminated = std::move(front).eliminate(pass.lambda);
    updates[i] = std::move(eliminated.update);
    result.factor.nodes[i] = std::move(eliminated.factor);
  }
  result.update = std::move(updates.back());
  return result;
}

TileStep solve_tile_down(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                         const TileFactor& factor, const Step& boundary, const TileDatum& datum) {
  if (factor.empty()) {
    const TileFactor again = condense_tile(problem, plan, state, pass, datum).factor;
    return solve_tile_down(problem, plan, state, pass, again, boundary);
  }
  TileStep result;
  result.points.assign(problem.points.size(), Eigen::Vector3d::Zero());
  result.unknowns.unknowns = plan.unknowns;
  const std::vector<std::int64_t> offsets = row_offsets(plan.unknowns);
  const std::int64_t columns = factor.nodes.back().right_hand_sides, rows_in_all = offsets.back();
  result.unknowns.columns = columns;
  result.unknowns.values.assign(at(rows_in_all * columns), 0);

  // Fronts from the top; each front's step is complete when its cell is reached.
  const std::vector<PlanNode>& nodes = plan.cells.nodes;
  std::vector<Step> steps(nodes.size());
  for (std::size_t i = nodes.size(); i-- > 0;) {
    const Step& outer = nodes[i].parent < 0 ? boundary : steps[at(nodes[i].parent)];
    steps[i] = back_substitute(factor.nodes[i], outer);
    const UnknownList& own = i + 1 == nodes.size() ? steps[i].unknowns : nodes[i].eliminated;
    const Step part = steps[i].restricted_to(own);
    const std::vector<std::int64_t> rows = row_offsets(own);
    for (std::size_t u = 0; u < own.size(); ++u) {
      const std::int64_t target = find_unknown(plan.unknowns, own[u].id);
      for (std::int64_t c = 0; target >= 0 && c < columns; ++c)
        std::copy_n(part.values.begin() + rows[u] + c * rows.back(), own[u].dimension,
                    result.unknowns.values.begin() + offsets[at(target)] + c * rows_in_all);
    }
  }

  const double* x = result.unknowns.values.data();
  PointEquations equations(problem, plan, state);
  DampingNorm damping(plan);
  for (const auto& cell : plan.points) {
    for (std::int64_t point : cell) {
      equations.linearise(point, pass);
      Eigen::Vector3d y = equations.z();
      for (const auto& block : equations.blocks())
        y -= block.w.transpose() * Eigen::Map<const Eigen::VectorXd>(x + offsets[at(block.unknown)], block.dimension);
      const Eigen::Vector3d step = equations.inverse_factor().transpose() * y;
      result.points[at(point)] = step;
      result.damping_norm += equations.diagonal().dot(step.cwiseAbs2());
      for (const auto& observation : equations.observations())
        for (int b = 0; b < observation.block_count; ++b) damping.add(observation.blocks[at(b)]);
    }
  }
  for (std::size_t cell = 0; cell < plan.points.size(); ++cell)
    visit_terms(problem, plan, state, pass, cell, [&](const TermResidual& term) {
      for (int b = 0; b < term.block_count; ++b) damping.add(term.blocks[at(b)]);
    });
  result.damping_norm += damping.norm(result.unknowns);
  return result;
}

}  // namespace megablock
