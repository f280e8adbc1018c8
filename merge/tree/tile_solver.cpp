#include "merge/tree/tile_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "io/base/error.h"
#include "io/block/held_priors.h"
#include "merge/datum/gauge.h"
#include "merge/step/tile_trial.h"
#include "merge/tree/global_adjustment.h"

namespace megablock {

namespace {

// Sigmas. A point that is nearer to its optimum at held poses is left there, because the next step moves the poses on.
constexpr double kSettled = 1e-2;

// The sweeps over a tree of one leaf. Its leaf is the root, and no unknown is on a separator.
class LoneTile : public TreeRunner {
 public:
  LoneTile(const TileProblem& problem, const TilePlan& plan, TileState& state)
      : problem_(problem), plan_(plan), state_(state), cost_(evaluate_cost(problem, state)) {}

  UpReport up(const Sweep& sweep) override {
    // The datum of the present state, as in the sweeps over a block.
    gauge_ = make_gauge({tile_gauge(problem_, plan_, state_)}, sweep.held_before);
    TileCondensation condensed = condense_tile(problem_, plan_, state_, sweep,
                                               tile_datum(gauge_, 0, problem_, plan_, state_, DatumColumns::kNone));
    factor_ = std::move(condensed.factor);
    return {std::move(condensed.update.sums), gauge_.against_priors()};
  }

  DownReport down(const Sweep& sweep) override {
    const TileStep step = solve_tile_unknowns(plan_, factor_, Step());
    const std::vector<BlockMotion> motions =
        block_motions(gauge_, {motion_sums(gauge_, 0, problem_, plan_, state_, step.unknowns)});
    TileTrial trial = try_step(gauge_, motions, 0, problem_, plan_, state_, sweep, step, kSettled);
    trial_ = std::move(trial.state);
    trial_cost_ = trial.cost;
    return {trial.damping_norm, trial_cost_};
  }

  void accept() override {
    state_ = std::move(trial_);
    cost_ = trial_cost_;
  }
  void reject() override {}

  double cost() const { return cost_; }  // of the state; infinite when a point lies behind a camera
  std::int64_t defect() const { return gauge_.defect(); }

 private:
  const TileProblem& problem_;
  const TilePlan& plan_;
  TileState& state_;
  TileState trial_;
  double cost_, trial_cost_ = 0;
  TileFactor factor_;
  BlockGauge gauge_;
};

// The damping with which the iterations of a tile start. Where residuals are many sigmas, undamped steps go astray: of
// street rigs that were 2 m and 1 degree off, a tenth ended in another minimum. Where residuals are a few sigmas,
// damping only holds back the weak modes. The same is true where all positions are held and only the attitudes are
// wrong.
double initial_lambda(const TileProblem& problem, const TilePlan& plan, double cost) {
  // The cost per observation. Noise alone costs at most one: half the squares of two residuals of unit variance.
  constexpr double kPoor = 10;
  constexpr double kFar = 1e-2, kNear = 1e-10;
  const auto held_frames = std::count_if(problem.positions.begin(), problem.positions.end(),
                                         [](const auto& term) { return held(term.prior); });
  if (held_frames == std::ssize(problem.frames)) return kNear;
  std::int64_t observations = 0;
  for (const RowList& cell : plan.points)
    for (const std::int64_t point : cell.rows())
      observations += std::count(problem.kept.begin() + problem.begin[static_cast<std::size_t>(point)],
                                 problem.kept.begin() + problem.begin[static_cast<std::size_t>(point) + 1], 1);
  return cost > kPoor * static_cast<double>(observations) ? kFar : kNear;
}

std::int64_t unknown_count(const TilePlan& plan) {
  std::int64_t count = total_dimension(plan.unknowns);
  for (const RowList& cell : plan.points) count += 3 * cell.size();
  return count;
}

}  // namespace

AdjustSummary solve_by_condensation(const TileProblem& problem, TileState& state, const SolveOptions& options) {
  const TilePlan plan =
      make_lone_tile_plan(problem, options.camera_free.empty() ? problem.camera_free : options.camera_free);
  if (plan.unknowns.empty()) throw ComputeError("the tile has no observations to adjust");

  AdjustSummary result;
  LoneTile tile(problem, plan, state);
  result.initial_cost = tile.cost();
  result.usable = std::isfinite(tile.cost());
  if (result.usable) {
    GlobalOptions global;
    global.initial_lambda = initial_lambda(problem, plan, tile.cost());
    global.max_iterations = options.max_iterations;
    global.function_tolerance = options.function_tolerance;
    GlobalState steps = start_global(global);
    adjust_globally(tile, global, steps);
    result.iterations = steps.iterations;
  }
  result.final_cost = tile.cost();
  describe_solution(problem, state, unknown_count(plan), tile.defect(), result);
  if (!result.usable) result.text += ", failed: a point lies behind a camera that sees it";
  return result;
}

}  // namespace megablock
