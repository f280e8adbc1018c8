// The global Levenberg-Marquardt iteration of the whole block, as a state machine that knows nothing of how the passes
// are run: `next_action` says what to do, the `report_*` functions take what came out. The state is a plain struct, so
// that it can be written after every accepted iteration and picked up again in the middle.
//
// Damping after Nielsen (1999): lambda *= max(1/3, 1 - (2 rho - 1)^3) on acceptance, no floor; on rejection
// lambda *= max(10 nu, 1e-6 / lambda), nu *= 2. Tiles come adjusted and aligned, so lambda starts at 1e-10.
//
// A pass takes the curvature of the robust losses (tile_linearisation.h) while steps do what their model promises:
// after a step of gain ratio >= 0.75, until one falls short of it or is rejected.
//
// Stop on the Newton decrement d^2 = b'H^-1 b = sum |L^-1 b|^2 (every unknown is within d of its own posterior sigma of
// the optimum), measured with lambda = 0 and the weights of the covariances: when the decrement of a pass falls below
// the limit, the same state is condensed once more with lambda = 0, and that pass decides. When it does not confirm and
// its step is no good, the next step is damped and taken, however small. When the predicted decrease is below
// 1e3 eps F the cost cannot resolve it: the step is accepted, and the iteration goes on as long as d falls.
#pragma once

#include <functional>
#include <string>

#include "merge/tile/condense.h"

namespace megablock {

struct GlobalOptions {
  double initial_lambda = 1e-10;
  double max_decrement = 1e-4;  // posterior sigmas; exactness tests use 1e-7
  bool confirm = true;          // the limit with a pass of lambda = 0; without, a pass that is hardly damped may do
  int max_iterations = 50;      // accepted and rejected steps
  // Above 0: also stops when a step that is hardly damped changes the cost by less than this share of it, or promises
  // to. Of tiles on their own, which only start the block: not every weak mode is at its optimum then.
  double function_tolerance = 0;
  void check() const;  // throws InputError
};

// Result of an upward pass: sums at the root.
struct UpReport {
  SubtreeSums sums;
};

// Result of a downward pass and the evaluation of the trial state, summed over tiles in tile order.
struct DownReport {
  double damping_norm = 0;  // sum of TileStep::damping_norm
  double trial_cost = 0;    // infinite when a point falls behind a camera
};

enum class GlobalAction : std::int32_t {
  kUp = 0,      // linearise at the current state, condense and eliminate with `next_pass`
  kDown = 1,    // back-substitute, form the trial state, evaluate its cost
  kAccept = 2,  // the trial state becomes the current state (then call report_accepted); checkpoint here
  kReject = 3,  // forget the trial state (then call report_rejected)
  kStop = 4
};

enum class GlobalOutcome : std::int32_t {
  kRunning = 0,
  kConverged = 1,      // decrement below the limit on a pass with lambda = 0
  kRoundingFloor = 2,  // the decrement no longer falls and the cost cannot resolve a decrease
  kIterationLimit = 3,
  kFailed = 4  // no step decreases the cost
};

struct GlobalState {
  GlobalAction next = GlobalAction::kUp;
  GlobalOutcome outcome = GlobalOutcome::kRunning;
  double lambda = 1e-10, nu = 2;
  double pass_lambda = 1e-10;  // of the current pass: lambda, or 0 for a confirming pass
  double cost = 0, initial_cost = -1;
  double decrement_squared = 0;  // of the last upward pass
  double floor_decrement = -1;   // decrement before an unresolvable step, -1: the last step was resolvable
  double predicted = 0, trial_cost = 0;
  std::int32_t iterations = 0;  // steps tried
  std::int32_t accepted = 0;
  std::int32_t curvature = 0;       // the last step did what its model promised: the next one takes the losses' own
  std::int32_t pass_curvature = 0;  // of the current pass; 0 for a confirming pass
  std::int32_t confirm = 1;         // 0: a confirming pass failed at the current state and its step was rejected
};

GlobalState start_global(const GlobalOptions& options);
inline GlobalAction next_action(const GlobalState& state) { return state.next; }
inline Pass next_pass(const GlobalState& state) { return {state.pass_lambda, state.pass_curvature != 0}; }
void report_up(GlobalState& state, const GlobalOptions& options, const UpReport& report);
void report_down(GlobalState& state, const GlobalOptions& options, const DownReport& report);
void report_accepted(GlobalState& state, const GlobalOptions& options);
void report_rejected(GlobalState& state, const GlobalOptions& options);

// What the global adjustment asks of the runner of the tree (merge_tree_runner.h), or of a single tile
// (tile_solver.cpp).
class TreeRunner {
 public:
  virtual ~TreeRunner() = default;
  virtual UpReport up(const Pass& pass) = 0;      // at the current state
  virtual DownReport down(const Pass& pass) = 0;  // after up(pass)
  virtual void accept() = 0;
  virtual void reject() = 0;
};

// Runs until kStop. `on_iteration` (may be empty) is called after every accepted or rejected step and at the end, when
// `state` can be stored. Starting from a stored state resumes.
void adjust_globally(TreeRunner& runner, const GlobalOptions& options, GlobalState& state,
                     const std::function<void(const GlobalState&)>& on_iteration = {});

// One line for the log and the report.
std::string describe(const GlobalState& state);

}  // namespace megablock
