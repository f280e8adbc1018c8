// The whole merge tree in one process: tests, one-rank runs, and the reference for every distributed runner.
#pragma once

#include <string>
#include <vector>

#include "merge/checks/seam_check.h"
#include "merge/datum/inner_constraints.h"
#include "merge/step/block_motion.h"
#include "merge/step/memory.h"
#include "merge/tile/condense.h"
#include "merge/tree/global_adjustment.h"
#include "merge/tree/node.h"

namespace megablock {

class SerialRunner : public TreeRunner {
 public:
  // problems[t] and states[t] of tile t; the states' common unknowns must agree. `solver` outlives the runner.
  SerialRunner(const MergeTree& tree, std::vector<TileProblem> problems, std::vector<TileState> states,
               MemoryOptions memory = {}, const NodeSolver& solver = dense_node_solver());
  ~SerialRunner() override;

  UpReport up(const Pass& pass) override;
  DownReport down(const Pass& pass) override;
  void accept() override;
  void reject() override;

  // The pass that ends a run: up(0) with the seam checks.
  UpReport final_up();
  // After final_up(): posterior covariances per tile, with inner constraints where the datum is free.
  std::vector<TileCovariance> covariances();
  // Seams of all inner nodes in node order, from final_up().
  const std::vector<SeamReport>& seams() const { return seams_; }

  // Every tile against the rest of the block, after final_up(); recomputes.
  std::vector<TileCheck> tile_checks();

  const EliminationPlan& plan() const { return plan_; }
  const std::vector<TilePlan>& tile_plans() const { return tile_plans_; }
  const std::vector<TileProblem>& problems() const { return problems_; }
  const std::vector<TileState>& states() const { return states_; }
  const std::vector<TileStep>& steps() const { return steps_; }  // of the last down()
  const BlockGauge& block_gauge() const { return block_gauge_; }
  const GaugeReport& gauge() const { return gauge_; }  // of the last final_up()
  const MemoryStatistics& memory() const { return factors_.statistics(); }

 private:
  // Update matrix of a node's subtree; its factors go to the store.
  UpdateMatrix condense_subtree(std::int64_t node, const Pass& pass, bool check_seams);
  // Factor of an inner node or a tile; recomputes the subtree where it was dropped.
  const NodeFactors& inner_factor(std::int64_t node, const Pass& pass);
  void down_from(std::int64_t node, const Pass& pass, const Step& parent);
  void covariances_from(std::int64_t node, CovarianceMatrix passed, std::vector<TileCovariance>& result);
  BlockGauge find_gauge() const;
  TileDatum datum_of(std::size_t tile) const;
  UpReport run_up(const Pass& pass, bool final_pass);
  void inner_constraints(std::vector<TileCovariance>& covariances);
  std::int64_t seam_count() const;

  std::vector<TileProblem> problems_;
  std::vector<TileState> states_, trial_;
  std::vector<TilePlan> tile_plans_;
  std::vector<TileStep> steps_;
  EliminationPlan plan_;
  FactorStore factors_;
  const NodeSolver& solver_;
  BlockGauge block_gauge_;
  bool with_columns_ = false;  // the last pass carries the further right-hand sides of a free datum
  GaugeReport gauge_;
  std::vector<SeamReport> seams_;
};

}  // namespace megablock
