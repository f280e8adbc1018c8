// Condenses a problem of one tile, which is a whole block, on its unknowns of one kind.
#pragma once

#include "merge/datum/gauge.h"
#include "merge/plan/tile_plan.h"
#include "merge/tile/condense.h"

namespace megablock {

// The normal equations of the cameras or mounts of a block at this state, with their priors and without damping. The
// constraints of a free datum are in them.
inline UpdateMatrix condense_on(UnknownKind kind, const TileProblem& problem, const TileState& state) {
  PlanNode node;
  node.leaf = 0;
  for (const Unknown& u : tile_unknowns(problem)) {
    (u.id.kind == kind ? node.separator : node.eliminated).push_back(u);
    node.owned.push_back(u);
  }
  const TilePlan plan = make_tile_plan(problem, node);
  const BlockGauge gauge = make_gauge({tile_gauge(problem, plan, state)});
  return condense_tile(problem, plan, state, 0, tile_datum(gauge, 0, problem, plan, state, DatumColumns::kNone)).update;
}

}  // namespace megablock
