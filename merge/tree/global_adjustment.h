// Decides on the Levenberg-Marquardt iterations of the whole block: damping, acceptance and convergence. It is a state
// machine that does not know how sweeps are run: `next_action` says what to do, and the `report_*` functions take the
// results. The state is a plain struct, so that it can be stored after every accepted iteration and resumed later.
//
// With the residuals r, weighted by their losses, at the present state, b = -J'r, H = J'J and D = diag(H), a sweep
// solves (H + lambda D) x = b. The cost F then decreases, by the quadratic model F - b'x + 1/2 x'H x, by
//
//     predicted = b'x - 1/2 x'H x = 1/2 (b'x + lambda x'D x) = 1/2 (|L^-1 b|^2 + lambda x'D x),
//
// because H x = b - lambda D x and b'x = b'(H + lambda D)^-1 b = |L^-1 b|^2. The first term comes from the sweep up
// (SubtreeSums::decrement_squared), the second from the sweep down (TileStep::damping_norm). The gain ratio rho is the
// true decrease over the predicted one.
//
// Damping follows Nielsen (1999): lambda *= max(1/3, 1 - (2 rho - 1)^3) on acceptance, without a floor; on rejection
// lambda *= max(10 nu, 1e-6 / lambda) and nu *= 2. The tiles are adjusted and aligned beforehand, so lambda starts at
// 1e-10. The first rejection therefore raises lambda to 1e-6 at once. Control of a metre tells the rotation of a block
// of forty images 1e-11 times as well as their observations tell those of the frames. Even 1e-10 then holds this
// rotation back, so that a further adjustment begins with the damping that the one before has reached.
//
// A sweep up takes the curvature of the robust losses (tile_linearisation.h) while steps decrease the cost as
// predicted: after a step of gain ratio >= 0.75, until a step has a smaller one or is rejected.
//
// The iterations stop on the Newton decrement d^2 = b'H^-1 b = sum |L^-1 b|^2. The undamped step of an unknown k with
// the posterior sigma sigma_k = sqrt(e_k'H^-1 e_k) is x_k = e_k'H^-1 b, and by Cauchy and Schwarz |x_k| <= sigma_k d:
// every unknown is then within d of its own posterior sigma of the optimum. The change of the cost bounds nothing of
// the kind: on a chain of 2 500 frames with control at each kilometre it became small with the block 2.7 sigmas (0.36
// m) off.
//
// The decrement is measured with lambda = 0 and with the weights of the covariances. When the decrement of a sweep
// falls below the limit, the same state is condensed once more with lambda = 0, and the decrement of that sweep
// decides. When it does not confirm convergence and its step is rejected, the next step is damped and tried, however
// small its decrement is. When the predicted decrease is below 1e3 eps F, the cost F cannot resolve it: the step is
// accepted, and the iterations go on as long as d falls.
#pragma once

#include <functional>
#include <string>

#include "merge/tile/condense.h"

namespace megablock {

struct GlobalOptions {
  double initial_lambda = 1e-10;
  double max_decrement = 1e-4;  // posterior sigmas; exactness tests use 1e-7
  // A sweep with lambda = 0 must confirm the limit. If false, a sweep that is hardly damped suffices.
  bool confirm = true;
  int max_iterations = 50;  // accepted and rejected steps
  // Above 0, the iterations also stop when a hardly damped step changes the cost by less than this share of it, or is
  // predicted to. It is meant for single tiles, which only start the block: not every weak mode is at its optimum then.
  double function_tolerance = 0;
  void check() const;  // throws InputError
};

// The result of a sweep up: the sums at the root.
struct UpReport {
  SubtreeSums sums;
  HeldAgainstPriors held{};
};

// The result of a sweep down and of the evaluation of the trial state, summed over the tiles in their order.
struct DownReport {
  double damping_norm = 0;  // sum of TileStep::damping_norm
  double trial_cost = 0;    // infinite when a point falls behind a camera
};

enum class GlobalAction : std::int32_t {
  kUp = 0,      // linearise at the current state, condense and eliminate with `next_sweep`
  kDown = 1,    // back-substitute, form the trial state, evaluate its cost
  kAccept = 2,  // the trial state becomes the current state (then call report_accepted); checkpoint here
  kReject = 3,  // forget the trial state (then call report_rejected)
  kStop = 4
};

enum class GlobalOutcome : std::int32_t {
  kRunning = 0,
  kConverged = 1,      // the decrement of a sweep with lambda = 0 is below the limit
  kRoundingFloor = 2,  // the decrement no longer falls and the cost cannot resolve a decrease
  kIterationLimit = 3,
  kFailed = 4  // no step decreases the cost
};

struct GlobalState {
  GlobalAction next = GlobalAction::kUp;
  GlobalOutcome outcome = GlobalOutcome::kRunning;
  double lambda = 1e-10, nu = 2;
  double sweep_lambda = 1e-10;  // of the current sweep: lambda, or 0 for a confirming sweep
  double cost = 0, initial_cost = -1;
  double decrement_squared = 0;  // of the last sweep up
  // The decrement before a step that the cost could not resolve; -1: it resolved the last step.
  double floor_decrement = -1;
  double predicted = 0, trial_cost = 0;
  std::int32_t iterations = 0;  // steps tried
  std::int32_t accepted = 0;
  // 1: the last step decreased the cost as predicted, and the next one takes the curvature of the losses
  std::int32_t curvature = 0;
  std::int32_t sweep_curvature = 0;  // of the current sweep; 0 for a confirming sweep
  std::int32_t confirm = 1;          // 0: a confirming sweep failed at the current state and its step was rejected
  // What sweeps have held against priors: the number of rotations, and 4 where a scale was held.
  std::int32_t held = 0;
};

GlobalState start_global(const GlobalOptions& options);
// Another adjustment of the same block, after the weights of its observations have changed. It keeps the number of
// accepted steps, what sweeps have held, and a damping that has fallen below that of the options.
GlobalState start_again(const GlobalState& before, const GlobalOptions& options);
inline GlobalAction next_action(const GlobalState& state) { return state.next; }
inline Sweep next_sweep(const GlobalState& state) {
  return {state.sweep_lambda, state.sweep_curvature != 0, {state.held % 4, state.held >= 4}};
}
void report_up(GlobalState& state, const GlobalOptions& options, const UpReport& report);
void report_down(GlobalState& state, const GlobalOptions& options, const DownReport& report);
void report_accepted(GlobalState& state, const GlobalOptions& options);
void report_rejected(GlobalState& state, const GlobalOptions& options);

// The sweeps that the global adjustment asks for. The runner of the tree (merge_tree_runner.h) implements them, and so
// does a single tile (tile_solver.cpp).
class TreeRunner {
 public:
  virtual ~TreeRunner() = default;
  virtual UpReport up(const Sweep& sweep) = 0;      // at the current state
  virtual DownReport down(const Sweep& sweep) = 0;  // after up(pass)
  virtual void accept() = 0;
  virtual void reject() = 0;
};

// Iterates until kStop. `on_iteration` (may be empty) is called after every accepted or rejected step and at the end;
// `state` can be stored then. A stored state resumes the iterations.
void adjust_globally(TreeRunner& runner, const GlobalOptions& options, GlobalState& state,
                     const std::function<void(const GlobalState&)>& on_iteration = {});

// One line for the log and the report.
std::string describe(const GlobalState& state);

}  // namespace megablock
