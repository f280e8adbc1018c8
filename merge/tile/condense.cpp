// Every front is filled in the same order: the points of the cell, its other observations, the left child, the right
// child. Which thread does it does not matter, so that the bits of a tile do not depend on the number of threads. A
// thread keeps its working memory for the whole tile: the lanes and tables of PointEquations, the blocks of pairs, and
// the memory of small fronts, which another front takes up as soon as a child has been added to its parent.
#include "merge/tile/condense.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/numbers/decompositions.h"
#include "merge/plan/point_portions.h"
#include "merge/plan/tree_workers.h"
#include "merge/plan/unknowns.h"
#include "merge/tile/cell_assembler.h"
#include "merge/tile/cluster_scores.h"
#include "merge/tile/point_equations.h"

namespace megablock {

namespace {

// Fills the front of a cell with all of the tile's residuals that the cell owns.
void fill_cell(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
               const PlanNode& node, const ClusterWeights* clusters, PointEquations& equations, PairBlocks& pair_blocks,
               std::vector<double>& diagonal, Front& front) {
  CellAssembler assembler(plan, front, pair_blocks);
  std::optional<ClusterScores> scores;
  if (clusters != nullptr) scores.emplace(problem, plan, *clusters, front);
  const std::vector<std::int32_t> points = plan.points[at(node.leaf)].rows();
  for (std::span<const std::int32_t> rest = points; !rest.empty();) {
    rest = rest.subspan(equations.linearise(rest, sweep));
    assembler.add_points(equations);
    if (scores) scores->add_points(equations);
  }
  visit_terms(problem, plan, state, sweep, at(node.leaf),
              [&](const TermResidual& term) { assembler.add_term(scores ? ClusterScores::with_formal(term) : term); });
  assembler.finish(diagonal);
  if (scores) scores->finish();
}

// Adds the datum of a tile to a front. It is added where its unknown is eliminated or, for separator unknowns, at the
// top of the tile, where the diagonal is that of the whole tile.
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
      // Where nothing observes the unknown, any weight holds it.
      const Eigen::Matrix<double, 6, 1> root =
          Eigen::Map<const Eigen::Matrix<double, 6, 1>>(front.diagonal() + row).unaryExpr([](double d) {
            return d > 0 ? std::sqrt(d) : 1;
          });
      // B'B = weight D^1/2 Q Q'D^1/2 (gauge.h).
      const Eigen::MatrixXd scaled = root.asDiagonal() * hold.directions;
      const Eigen::MatrixXd basis = orthonormal_basis(scaled);
      const Eigen::MatrixXd weight = root.asDiagonal() * (basis * basis.transpose()) * root.asDiagonal();
      add_block(front, row, row, hold.weight * weight);
    }
  }
}

}  // namespace

std::int64_t TileFactor::byte_count() const {
  std::int64_t sum = 0;
  for (const FrontFactor& node : nodes) sum += node.byte_count();
  return sum + static_cast<std::int64_t>(diagonal.size() * sizeof(double));
}

void TileFactor::write(ByteWriter& out) const {
  out.value<std::uint64_t>(nodes.size());
  for (const FrontFactor& node : nodes) node.write(out);
  out.values(diagonal);
}

TileFactor TileFactor::read(ByteReader& in) {
  TileFactor factor;
  const auto count = in.value<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) factor.nodes.push_back(FrontFactor::read(in));
  factor.diagonal = in.values<double>();
  return factor;
}

// The nodes of the tree share three lists, and each node writes its own entry. An update is freed as soon as the parent
// has it.
class TileCondenser::Work {
 public:
  Work(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep, TileDatum datum)
      : problem_(problem),
        plan_(plan),
        state_(state),
        sweep_(sweep),
        datum_(std::move(datum)),
        nodes_(plan.cells.nodes),
        tree_(nodes_),
        tables_(problem, plan, state),
        threads_([this] {
          return std::unique_ptr<OfThread>(new OfThread{{problem_, state_, tables_}, {}, {}});
        }),
        updates_(nodes_.size()),
        diagonals_(plan.points.size()),
        factors_(nodes_.size()) {}
  std::int64_t cells() const { return tree_.leaves(); }
  void condense(std::int64_t cell) {
    tree_.ascend(cell, [&](std::int64_t n) { eliminate(n); });
  }
  TileCondensation take();

 private:
  // The working memory of a thread.
  struct OfThread {
    PointEquations equations;
    PairBlocks pair_blocks;
    FrontMemory memory;
  };
  void eliminate(std::int64_t node);

  const TileProblem& problem_;
  const TilePlan& plan_;
  const TileState& state_;
  const Sweep sweep_;
  const TileDatum datum_;
  const std::vector<PlanNode>& nodes_;
  ChildrenFirst tree_;
  const PointTables tables_;
  PerThread<OfThread> threads_;
  std::vector<UpdateMatrix> updates_;           // [nodes]
  std::vector<std::vector<double>> diagonals_;  // of J'J of each cell
  std::vector<FrontFactor> factors_;            // [nodes]
};

void TileCondenser::Work::eliminate(std::int64_t number) {
  const PlanNode& node = nodes_[at(number)];
  OfThread& mine = threads_.mine();
  // The first right-hand side is -J'r, the others are the columns of the datum.
  Front front(node.eliminated, node.separator, 1 + datum_.columns.columns, &mine.memory);
  if (node.leaf >= 0) {
    std::vector<double>& diagonal = diagonals_[at(node.leaf)];
    diagonal.assign(at(total_dimension(plan_.unknowns)), 0);
    fill_cell(problem_, plan_, state_, sweep_, node, datum_.clusters, mine.equations, mine.pair_blocks, diagonal,
              front);
  }
  for (std::int64_t child : {node.left, node.right}) {
    if (child < 0) continue;
    front.add(updates_[at(child)]);
    mine.memory.give(std::move(updates_[at(child)].matrix));
    updates_[at(child)] = UpdateMatrix();
  }
  add_datum(datum_, node.eliminated, front);
  if (at(number) + 1 == nodes_.size()) add_datum(datum_, node.separator, front);
  Front::Result eliminated = std::move(front).eliminate(sweep_.lambda);
  updates_[at(number)] = std::move(eliminated.update);
  factors_[at(number)] = std::move(eliminated.factor);
}

TileCondensation TileCondenser::Work::take() {
  tree_.rethrow();
  TileCondensation result;
  result.factor.nodes = std::move(factors_);
  result.factor.diagonal.assign(at(total_dimension(plan_.unknowns)), 0);
  for (const std::vector<double>& diagonal : diagonals_)
    for (std::size_t k = 0; k < diagonal.size(); ++k) result.factor.diagonal[k] += diagonal[k];
  result.update = std::move(updates_.back());
  result.update.matrix.shrink_to_fit();  // frees memory, because the update waits for that of the sibling
  return result;
}

TileCondenser::TileCondenser(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                             const Sweep& sweep, TileDatum datum)
    : work_(std::make_unique<Work>(problem, plan, state, sweep, std::move(datum))) {}

TileCondenser::~TileCondenser() = default;

std::int64_t TileCondenser::cells() const { return work_->cells(); }

void TileCondenser::condense(std::int64_t cell) { work_->condense(cell); }

TileCondensation TileCondenser::take() { return work_->take(); }

TileCondensation condense_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const Sweep& sweep, const TileDatum& datum) {
  TileCondenser tile(problem, plan, state, sweep, datum);
  visit_in_parallel(tile.cells(), [&](std::int64_t cell) { tile.condense(cell); });
  return tile.take();
}

TileStep solve_tile_unknowns(const TilePlan& plan, const TileFactor& factor, const Step& boundary) {
  TileStep result;
  result.unknowns.unknowns = plan.unknowns;
  const std::vector<std::int64_t> offsets = row_offsets(plan.unknowns);
  const std::int64_t columns = factor.nodes.back().right_hand_sides, rows_in_all = offsets.back();
  result.unknowns.columns = columns;
  result.unknowns.values.assign(at(rows_in_all * columns), 0);

  // Fronts are solved from the top down, so that the step of the parent is known.
  const std::vector<PlanNode>& nodes = plan.cells.nodes;
  std::vector<Step> steps(nodes.size());
  for (std::size_t i = nodes.size(); i-- > 0;) {
    const Step& outer = nodes[i].parent < 0 ? boundary : steps[at(nodes[i].parent)];
    steps[i] = back_substitute(factor.nodes[i], outer);
    // The top front gives the separator as well. Its step is then in the result like any other.
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
  for (std::size_t i = 0; i < factor.diagonal.size(); ++i) result.damping_norm += factor.diagonal[i] * x[i] * x[i];
  return result;
}

TileStep solve_tile_down(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                         const TileFactor& factor, const Step& boundary, const TileDatum& datum) {
  TileStep step = solve_tile_unknowns(
      plan, factor.empty() ? condense_tile(problem, plan, state, sweep, datum).factor : factor, boundary);
  step.points.assign(problem.points.size(), Eigen::Vector3d::Zero());
  const UnknownMotions motions(plan, step.unknowns.values.data());
  const PointTables tables(problem, plan, state);
  PointEquations equations(problem, state, tables);
  // The sums follow the portions, so that they have the bits of those in tile_trial.cpp.
  const PointPortions portions(plan);
  for (std::int64_t portion = 0; portion < portions.size(); ++portion) {
    double damping_norm = 0;
    for (std::span<const std::int32_t> rest = portions[portion]; !rest.empty();) {
      rest = rest.subspan(equations.linearise(rest, sweep));
      equations.steps(motions, step.points);
      for (std::size_t i = 0; i < equations.points().size(); ++i)
        damping_norm += equations.diagonal(i).dot(step.points[at(equations.points()[i].point)].cwiseAbs2());
    }
    step.damping_norm += damping_norm;
  }
  return step;
}

}  // namespace megablock
