// The state of a tile that a step leads to, and its cost: what comes of condense.h's solve_tile_down, block_motion.h's
// apply_step and point_refinement.h's refine_points one behind the other, bit for bit. In one go every point's
// measurements are read once instead of twice and still stand in the lanes when the new state is evaluated, no steps of
// points are kept, and threads meet once.
#pragma once

#include <memory>

#include "merge/step/block_motion.h"
#include "merge/tile/point_refinement.h"

namespace megablock {

struct TileTrial {
  TileState state;
  double cost = 0;
  double damping_norm = 0;  // as TileStep
};
// `step`: of the unknowns (solve_tile_unknowns).
TileTrial try_step(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                   const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                   const TileStep& step, double settled = kPointSettled);

// The same in parts, by threads that may be at work on other tiles, too (geometry/threads/rounds.h).
class TileTrialMaker {
 public:
  // All but the pass outlive it.
  TileTrialMaker(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                 const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                 const TileStep& step, double settled = kPointSettled);
  ~TileTrialMaker();
  std::int64_t portions() const;
  void visit(std::int64_t portion);  // every one once
  TileTrial take();                  // once all are done

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace megablock
