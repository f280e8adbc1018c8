#include "merge/tile/tile_linearisation.h"

#include "adjust/terms/terms.h"

namespace megablock {

namespace {

// The columns of the free parameters of a camera, in the order of its unknowns.
TermResidual::Jacobian free_columns(const LinearTerm::Jacobian& by_parameters, ParameterMask free) {
  TermResidual::Jacobian columns(by_parameters.rows(), count_of(free));
  Eigen::Index column = 0;
  for (int p = 0; p < by_parameters.cols(); ++p)
    if (contains(free, p)) columns.col(column++) = by_parameters.col(p);
  return columns;
}

void add_block(const LinearTerm::Block& block, const TilePlan& plan, TermResidual& term) {
  const auto row = static_cast<std::size_t>(block.row);
  switch (block.by) {
    case LinearTerm::By::kFrame:
      return term.add_block(plan.unknown_of_frame[row], block.jacobian);
    case LinearTerm::By::kMount:
      return term.add_block(plan.unknown_of_mount[row], block.jacobian);
    case LinearTerm::By::kCamera:
      return term.add_block(plan.unknown_of_camera[row], free_columns(block.jacobian, plan.camera_free[row]));
  }
}

}  // namespace

void visit_terms(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                 std::size_t cell, const std::function<void(const TermResidual&)>& visit) {
  const TermVisit visit_weighted = [&](const LinearTerm& term) {
    TermResidual out;
    out.residual = term.residual;
    out.kinds = term.kinds;
    for (int b = 0; b < term.block_count; ++b) add_block(term.blocks[static_cast<std::size_t>(b)], plan, out);
    out.weight(term.loss, sweep);
    visit(out);
  };
  const auto types = observation_types();
  for (const TermRow& term : plan.terms[cell])
    types[static_cast<std::size_t>(term.type)]->linearise(problem, state, static_cast<std::size_t>(term.row),
                                                          visit_weighted);
}

}  // namespace megablock
