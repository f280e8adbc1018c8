// Makes the trial state of a tile after a step, and computes its cost.
//
// The result has the same bits as solve_tile_down (condense.h), apply_step (block_motion.h) and refine_points
// (point_refinement.h), one after the other. Together they read the observations of a point once instead of twice,
// evaluate the new state while the observations are still in the lanes, and store no steps of points. The threads
// synchronise only once.
#pragma once

#include <memory>

#include "merge/step/block_motion.h"
#include "merge/tile/point_refinement.h"

namespace megablock {

// The state after the step, with the points in the tail of the loss at their own optimum.
struct TileTrial {
  TileState state;
  // 1/2 sum rho over all observations of the tile; infinite when a point is behind a camera.
  double cost = 0;
  double damping_norm = 0;  // as in TileStep
};
// `step` holds the step of the unknowns alone, from solve_tile_unknowns.
TileTrial try_step(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                   const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                   const TileStep& step, double settled = kPointSettled);

// The same in portions, for threads that may work on other tiles as well (geometry/threads/rounds.h).
class TileTrialMaker {
 public:
  // All arguments except the pass outlive the object.
  TileTrialMaker(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                 const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                 const TileStep& step, double settled = kPointSettled);
  ~TileTrialMaker();
  std::int64_t portions() const;
  void visit(std::int64_t portion);  // call once for every portion
  TileTrial take();                  // after the last portion

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace megablock
