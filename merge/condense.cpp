#include "merge/condense.h"

#include <algorithm>
#include <cmath>

#include "geometry/decompositions.h"
#include "merge/cell_assembler.h"
#include "merge/point_equations.h"
#include "merge/point_portions.h"
#include "merge/tree_workers.h"
#include "merge/unknowns.h"

namespace megablock {

namespace {

void fill_cell(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
               const PlanNode& node, PointEquations& equations, PairBlocks& pair_blocks, std::vector<double>& diagonal,
               Front& front) {
  CellAssembler assembler(plan, front, pair_blocks);
  const std::vector<std::int32_t> points = plan.points[at(node.leaf)].rows();
  for (std::span<const std::int32_t> rest = points; !rest.empty();) {
    rest = rest.subspan(equations.linearise(rest, pass));
    assembler.add_points(equations);
  }
  visit_terms(problem, plan, state, pass, at(node.leaf), [&](const TermResidual& term) { assembler.add_term(term); });
  assembler.finish(diagonal);
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
      // Any weight holds what nothing observes.
      const Eigen::Matrix<double, 6, 1> root =
          Eigen::Map<const Eigen::Matrix<double, 6, 1>>(front.diagonal() + row).unaryExpr([](double d) {
            return d > 0 ? std::sqrt(d) : 1;
          });
      const Eigen::MatrixXd scaled = root.asDiagonal() * hold.directions;
      const Eigen::MatrixXd basis = orthonormal_basis(scaled);
      const Eigen::MatrixXd weight = root.asDiagonal() * (basis * basis.transpose()) * root.asDiagonal();
      add_block(front, row, row, weight);
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

namespace {

// What a thread works with.
struct Workspace {
  PointEquations equations;
  PairBlocks pair_blocks;
  FrontMemory memory;
};

}  // namespace

TileCondensation condense_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const Pass& pass, const TileDatum& datum) {
  const std::int64_t right_hand_sides = 1 + datum.columns.columns;
  const std::vector<PlanNode>& nodes = plan.cells.nodes;
  const PointTables tables(problem, plan, state);
  PerThread<Workspace> workspaces([&] {
    return std::unique_ptr<Workspace>(new Workspace{{problem, state, tables}, {}, {}});
  });
  std::vector<UpdateMatrix> updates(nodes.size());
  std::vector<std::vector<double>> diagonals(plan.points.size());  // of J'J of each cell
  TileCondensation result;
  result.factor.nodes.resize(nodes.size());
  visit_children_first(nodes, [&](std::int64_t i) {
    const PlanNode& node = nodes[at(i)];
    Workspace& mine = workspaces.mine();
    Front front(node.eliminated, node.passed, right_hand_sides, &mine.memory);
    if (node.leaf >= 0) {
      std::vector<double>& diagonal = diagonals[at(node.leaf)];
      diagonal.assign(at(total_dimension(plan.unknowns)), 0);
      fill_cell(problem, plan, state, pass, node, mine.equations, mine.pair_blocks, diagonal, front);
    }
    for (std::int64_t child : {node.left, node.right}) {
      if (child < 0) continue;
      front.add(updates[at(child)]);
      mine.memory.give(std::move(updates[at(child)].matrix));
      updates[at(child)] = UpdateMatrix();
    }
    add_datum(datum, node.eliminated, front);
    if (at(i) + 1 == nodes.size()) add_datum(datum, node.passed, front);
    Front::Result eliminated = std::move(front).eliminate(pass.lambda);
    updates[at(i)] = std::move(eliminated.update);
    result.factor.nodes[at(i)] = std::move(eliminated.factor);
  });
  result.factor.diagonal.assign(at(total_dimension(plan.unknowns)), 0);
  for (const std::vector<double>& diagonal : diagonals)
    for (std::size_t k = 0; k < diagonal.size(); ++k) result.factor.diagonal[k] += diagonal[k];
  result.update = std::move(updates.back());
  result.update.matrix.shrink_to_fit();  // waits for its sibling
  return result;
}

TileStep solve_tile_unknowns(const TilePlan& plan, const TileFactor& factor, const Step& boundary) {
  TileStep result;
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
  for (std::size_t i = 0; i < factor.diagonal.size(); ++i) result.damping_norm += factor.diagonal[i] * x[i] * x[i];
  return result;
}

TileStep solve_tile_down(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                         const TileFactor& factor, const Step& boundary, const TileDatum& datum) {
  TileStep step = solve_tile_unknowns(
      plan, factor.empty() ? condense_tile(problem, plan, state, pass, datum).factor : factor, boundary);
  step.points.assign(problem.points.size(), Eigen::Vector3d::Zero());
  const UnknownMotions motions(plan, step.unknowns.values.data());
  const PointTables tables(problem, plan, state);
  PointEquations equations(problem, state, tables);
  const PointPortions portions(plan);
  for (std::int64_t portion = 0; portion < portions.size(); ++portion) {
    double damping_norm = 0;
    for (std::span<const std::int32_t> rest = portions[portion]; !rest.empty();) {
      rest = rest.subspan(equations.linearise(rest, pass));
      equations.steps(motions, step.points);
      for (std::size_t i = 0; i < equations.points().size(); ++i)
        damping_norm += equations.diagonal(i).dot(step.points[at(equations.points()[i].point)].cwiseAbs2());
    }
    step.damping_norm += damping_norm;
  }
  return step;
}

}  // namespace megablock
