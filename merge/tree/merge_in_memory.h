// Merges a block whose tiles are all in memory, in one process. It serves blocks of one tile, comparisons and tests. It
// holds the runner of the merge tree (merge_tree_runner.h) with one rank, the tiles and the results.
#pragma once

#include <memory>
#include <vector>

#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// It keeps copies of the problems and states beside those of the store, so that callers can read both at any time.
class MergeInMemory : public TreeRunner {
 public:
  // `problems[t]` and `states[t]` belong to tile t. Unknowns that tiles share must have the same values in all of them.
  // `solver` outlives the object.
  MergeInMemory(const MergeTree& tree, std::vector<TileProblem> problems, std::vector<TileState> states,
                MemoryOptions memory = {}, const NodeSolver& solver = dense_node_solver());

  UpReport up(const Sweep& sweep) override { return runner_.up(sweep); }
  DownReport down(const Sweep& sweep) override;
  void accept() override;
  void reject() override { runner_.reject(); }

  // At the solution: runs a sweep up with lambda = 0 and computes seam checks, datum and covariances.
  UpReport final_up();
  // The results of final_up(): the covariances by tile, under inner constraints where the datum is free; the seams of
  // all inner nodes, in the order of the nodes; the check of every tile against the rest of the block; the datum.
  const std::vector<TileCovariance>& covariances() const { return covariances_; }
  // Of all frames of a small block together (MergeTreeRunner::Posterior).
  const CovarianceMatrix& frame_covariance() const { return posterior_.frames; }
  // After final_up(): the empirical covariances, by tile, and those of all frames of a small block.
  void final_scores();
  // Those of tie points are the formal ones.
  const std::vector<TileCovariance>& empirical_covariances() const { return empirical_; }
  const CovarianceMatrix& empirical_frame_covariance() const { return empirical_frames_; }
  const std::vector<SeamReport>& seams() const { return posterior_.seams; }
  const std::vector<TileCheck>& tile_checks() const { return posterior_.tile_checks; }
  const GaugeReport& gauge() const { return gauge_; }

  const EliminationPlan& plan() const { return runner_.plan(); }
  const std::vector<TilePlan>& tile_plans() const { return tile_plans_; }
  const std::vector<TileProblem>& problems() const { return problems_; }
  const std::vector<TileState>& states() const { return states_; }
  const BlockGauge& block_gauge() const { return runner_.gauge(); }  // of the last sweep up
  const MemoryStatistics& memory() const { return runner_.memory(); }
  // The steps of the last down() with those of the points; valid until accept().
  const std::vector<TileStep>& steps() const;

 private:
  void read_states();

  OneProcess process_;
  TileStore tiles_;
  MergeTreeRunner runner_;
  std::vector<TileProblem> problems_;
  std::vector<TileState> states_;
  std::vector<TilePlan> tile_plans_;
  Sweep sweep_ = 0;                      // of the last down()
  std::vector<Step> unknown_steps_;      // [tiles] of the last down()
  mutable std::vector<TileStep> steps_;  // [tiles] with the points; made when they are first asked for
  MergeTreeRunner::Posterior posterior_;
  std::vector<TileCovariance> covariances_, empirical_;
  CovarianceMatrix empirical_frames_;
  GaugeReport gauge_;
};

}  // namespace megablock
