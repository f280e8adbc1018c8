// Sweeps down the tree: computes the step of every unknown, and the trial state after the step.
//
// It has two parts. The first goes down the tree with the factors alone, down to the unknowns of all tiles, and reads
// no observations. The motion of the whole block (block_motion.h) needs the steps of all frames, so that the ranks meet
// here. The second part reads each tile once more, for its points and the cost of the trial state.
#include <utility>

#include "geometry/threads/rounds.h"
#include "merge/plan/unknowns.h"
#include "merge/tree/gather_by_tile.h"
#include "merge/tree/merge_tree_runner.h"
#include "merge/tree/stopwatch.h"
#include "merge/tree/sweep_values.h"

namespace megablock {

std::vector<TileStep> MergeTreeRunner::steps_down(const Sweep& sweep) {
  std::vector<TileStep> steps(tiles_.size());
  for (std::int64_t n = plan_.root(); n >= 0; --n) {
    if (!mine(n)) continue;
    // It is empty at the root.
    const Step separator = from_parent<Step>(n);
    const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
    const Stopwatch watch(node.leaf < 0 ? seconds_.fronts : seconds_.tiles);
    if (node.leaf < 0) {
      send_down(n, solver_.back_substitute(factors_of(n, sweep).front, separator));
      continue;
    }
    const std::size_t row = row_of_leaf(n);
    steps[row] = solve_tile_unknowns(tile_plans_[row], factors_of(n, sweep).tile, separator);
  }
  ranks_.flush_sends();
  return steps;
}

void MergeTreeRunner::try_steps(const std::vector<BlockMotion>& motions, const Sweep& sweep,
                                const std::vector<TileStep>& steps, const VisitTrial& visit) {
  const Stopwatch watch(seconds_.tiles);
  std::vector<std::unique_ptr<TileTrialMaker>> trials(tiles_.size());
  const auto prepare = [&](std::int64_t row) {
    const RankTile& tile = tiles_.whole(at(row));
    trials[at(row)] = std::make_unique<TileTrialMaker>(gauge_, motions, tile.tile, tile.problem, tile_plans_[at(row)],
                                                       tile.state, sweep, steps[at(row)]);
    return trials[at(row)]->portions();
  };
  visit_in_rounds({std::ssize(trials), prepare,
                   [&](std::int64_t row, std::int64_t portion) { trials[at(row)]->visit(portion); },
                   [&](std::int64_t row) { visit(at(row), std::exchange(trials[at(row)], nullptr)->take()); },
                   [&](std::int64_t row) { return in_memory(at(row)); }});
}

DownReport MergeTreeRunner::down(const Sweep& sweep) {
  struct Sums {
    double damping_norm = 0, trial_cost = 0;
  };
  const Stopwatch watch(seconds_.all);
  last_sweep_.reset();  // factors that are computed again lack what the posterior needs
  std::vector<TileStep> steps = steps_down(sweep);
  std::vector<MotionSums> own;
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.outline(row);
    own.push_back(motion_sums(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, steps[row].unknowns));
  }
  if (on_step_)
    for (std::size_t row = 0; row < steps.size(); ++row) on_step_(row, steps[row].unknowns);
  const std::vector<BlockMotion> motions =
      block_motions(gauge_, gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, own));
  std::vector<Sums> sums(tiles_.size());
  trial_gauges_.clear();
  try_steps(motions, sweep, steps, [&](std::size_t row, TileTrial trial) {
    sums[row] = {trial.damping_norm, trial.cost};
    // The whole tile is in memory now. If the step is accepted, the next sweep up finds the datum of its state without
    // reading the tiles.
    trial_gauges_.push_back(tile_gauge(tiles_.outline(row).problem, tile_plans_[row], trial.state));
    tiles_.put_trial(row, std::move(trial.state));
    // The step of the tile is not needed any more.
    steps[row] = {};
  });
  DownReport report;
  for (const Sums& tile : gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, sums)) {
    report.damping_norm += tile.damping_norm;
    report.trial_cost += tile.trial_cost;
  }
  return report;
}

void MergeTreeRunner::accept() {
  last_sweep_.reset();
  tiles_.accept();
  gauges_ = std::move(trial_gauges_);
}

void MergeTreeRunner::reject() { tiles_.reject(); }

}  // namespace megablock
