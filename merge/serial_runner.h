// The whole merge tree in one process: tests, one-rank runs, and the reference for every distributed runner.
#pragma once

#include <string>
#include <vector>

#include "merge/condense.h"
#include "merge/gauge.h"
#include "merge/global_adjustment.h"
#include "merge/memory.h"
#include "merge/node.h"
#include "merge/seam_check.h"

namespace megablock {

class SerialRunner : public TreeRunner {
 public:
  // problems[t] and states[t] of tile t; the states' common unknowns must agree.
  SerialRunner(const MergeTree& tree, std::vector<TileProblem> problems, std::vector<TileState> states,
               MemoryOptions memory = {});
  ~SerialRunner() override;

  UpReport up(double lambda) override;
  DownReport down(double lambda) override;
  void accept() override;
  void reject() override;

  // After a last up(0): posterior covariances per tile.
  std::vector<TileCovariance> covariances();
  // Seams of all inner nodes, from the last up(0).
  std::vector<SeamReport> seams() const;

  const EliminationPlan& plan() const { return plan_; }
  const std::vector<TilePlan>& tile_plans() const { return tile_plans_; }
  const std::vector<TileProblem>& problems() const { return problems_; }
  const std::vector<TileState>& states() const { return states_; }
  const std::vector<TileStep>& steps() const { return steps_; }  // of the last down()
  const GaugeReport& gauge() const { return gauge_; }            // of the last up(0)
  const MemoryStatistics& memory() const { return statistics_; }

 private:
  struct Factors;
  std::vector<TileProblem> problems_;
  std::vector<TileState> states_, trial_;
  std::vector<TilePlan> tile_plans_;
  std::vector<TileStep> steps_;
  EliminationPlan plan_;
  MemoryOptions memory_options_;
  MemoryStatistics statistics_;
  GaugeReport gauge_;
};

}  // namespace megablock
