#include "merge/tree/global_adjustment.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "io/base/error.h"
#include "io/text/counted.h"

namespace megablock {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kUnresolvable = 1e3 * kEpsilon;  // share of the cost: smaller decreases are lost in rounding
constexpr double kMaxLambda = 1e12;
constexpr double kTrustworthy = 0.75;  // gain ratio from which the next iteration takes the curvature of the losses
constexpr double kHardlyDamped = 1e-2;

void stop(GlobalState& state, GlobalOutcome outcome) {
  state.outcome = outcome;
  state.next = GlobalAction::kStop;
}

void accept(GlobalState& state, double gain_ratio) {
  // This is Nielsen's rule. A gain ratio above 1/2 lowers lambda, one below 1/2 raises it.
  const double x = 2 * gain_ratio - 1;
  state.lambda *= std::max(1.0 / 3, 1 - x * x * x);
  state.nu = 2;
  state.confirm = 1;
  state.curvature = gain_ratio >= kTrustworthy;
  state.next = GlobalAction::kAccept;
}

void reject(GlobalState& state) {
  state.lambda *= std::max(10 * state.nu, 1e-6 / state.lambda);
  state.nu *= 2;
  state.floor_decrement = -1;
  state.curvature = 0;
  // The undamped step has failed, so the next iteration is damped, and its decrement may be small without another
  // confirming sweep.
  if (state.sweep_lambda == 0) state.confirm = 0;
  state.next = GlobalAction::kReject;
}

// Whether a change of the cost is too small to continue. With strong damping a small change says nothing, because the
// damping keeps the steps small.
bool negligible(const GlobalState& state, const GlobalOptions& options, double change) {
  return options.function_tolerance > 0 && state.sweep_lambda <= kHardlyDamped &&
         std::abs(change) <= options.function_tolerance * state.cost;
}

// Starts the next iteration after an accepted or rejected step, or stops. Where several reasons apply, the last one
// below counts: what converges with its last permitted step has converged.
void start_sweep(GlobalState& state, const GlobalOptions& options) {
  state.sweep_lambda = state.lambda;
  state.sweep_curvature = state.curvature;
  state.next = GlobalAction::kUp;
  if (state.iterations >= options.max_iterations) stop(state, GlobalOutcome::kIterationLimit);
  if (negligible(state, options, state.cost - state.trial_cost)) stop(state, GlobalOutcome::kConverged);
  if (state.lambda > kMaxLambda) stop(state, GlobalOutcome::kFailed);
}

}  // namespace

void GlobalOptions::check() const {
  if (!(initial_lambda > 0)) throw InputError("initial_lambda must be positive");
  if (!(max_decrement > 0)) throw InputError("max_decrement must be positive (posterior sigmas)");
  if (max_iterations < 1) throw InputError("max_iterations must be at least 1");
}

GlobalState start_global(const GlobalOptions& options) {
  options.check();
  GlobalState state;
  state.lambda = state.sweep_lambda = options.initial_lambda;
  return state;
}

GlobalState start_again(const GlobalState& before, const GlobalOptions& options) {
  GlobalState state = start_global(options);
  constexpr double kLeast = 1e-30;  // a rejection divides by it
  state.lambda = state.sweep_lambda = std::clamp(before.lambda, kLeast, options.initial_lambda);
  state.accepted = before.accepted;
  state.held = before.held;
  return state;
}

void report_up(GlobalState& state, const GlobalOptions& options, const UpReport& report) {
  state.held = std::max(state.held % 4, report.held.rotations) + (state.held >= 4 || report.held.scale ? 4 : 0);
  state.cost = report.sums.cost;
  state.decrement_squared = report.sums.decrement_squared;
  if (state.initial_cost < 0) state.initial_cost = state.cost;
  if (!std::isfinite(state.cost) || !std::isfinite(state.decrement_squared)) return stop(state, GlobalOutcome::kFailed);
  if (negligible(state, options, 0.5 * state.decrement_squared)) return stop(state, GlobalOutcome::kConverged);
  const double decrement = std::sqrt(state.decrement_squared);
  const bool small = decrement <= options.max_decrement;
  // The last step was too small for the cost to judge, and the decrement has not fallen since: only rounding is left.
  const bool at_floor = state.floor_decrement >= 0 && decrement >= state.floor_decrement;
  // Damping makes the decrement smaller. A damped sweep can therefore only ask for an undamped one, which decides.
  // Single tiles need no confirmation, only a sweep that is hardly damped.
  if (state.sweep_lambda == 0) {
    if (small) return stop(state, GlobalOutcome::kConverged);
    if (at_floor) return stop(state, GlobalOutcome::kRoundingFloor);
  } else if (small && !options.confirm && state.sweep_lambda <= kHardlyDamped) {
    return stop(state, GlobalOutcome::kConverged);
  } else if ((small || at_floor) && state.confirm != 0) {
    state.sweep_lambda = 0;  // this undamped iteration decides on convergence
    state.sweep_curvature = 0;
    return;
  }
  state.next = GlobalAction::kDown;
}

void report_down(GlobalState& state, const GlobalOptions&, const DownReport& report) {
  ++state.iterations;
  state.trial_cost = report.trial_cost;
  state.predicted = 0.5 * (state.decrement_squared + state.sweep_lambda * report.damping_norm);
  const double decrease = state.cost - state.trial_cost;
  if (!std::isfinite(state.trial_cost)) return reject(state);
  // The cost can judge the step.
  if (state.predicted > kUnresolvable * state.cost) {
    state.floor_decrement = -1;
    return decrease > 0 ? accept(state, decrease / state.predicted) : reject(state);
  }
  // The expected decrease is below rounding here, so that the cost can only expose a plainly wrong step.
  if (-decrease > kUnresolvable * kUnresolvable + 1e6 * kEpsilon * state.cost) return reject(state);
  // The step is taken as if it did what the model promises. The next decrement tells whether it did.
  state.floor_decrement = std::sqrt(state.decrement_squared);
  accept(state, 1);
}

void report_accepted(GlobalState& state, const GlobalOptions& options) {
  ++state.accepted;
  start_sweep(state, options);
}

void report_rejected(GlobalState& state, const GlobalOptions& options) { start_sweep(state, options); }

void adjust_globally(TreeRunner& runner, const GlobalOptions& options, GlobalState& state,
                     const std::function<void(const GlobalState&)>& on_iteration) {
  while (state.next != GlobalAction::kStop) {
    switch (state.next) {
      case GlobalAction::kUp:
        report_up(state, options, runner.up(next_sweep(state)));
        break;
      case GlobalAction::kDown:
        report_down(state, options, runner.down(next_sweep(state)));
        break;
      case GlobalAction::kAccept:
        runner.accept();
        report_accepted(state, options);
        if (on_iteration) on_iteration(state);
        break;
      case GlobalAction::kReject:
        runner.reject();
        report_rejected(state, options);
        if (on_iteration) on_iteration(state);
        break;
      case GlobalAction::kStop:
        break;
    }
  }
  if (on_iteration) on_iteration(state);
}

std::string describe(const GlobalState& state) {
  static constexpr const char* kOutcomes[] = {"running", "converged", "converged to rounding", "stopped at the limit",
                                              "failed: no step decreases the cost"};
  char line[200];
  std::snprintf(line, sizeof line, "global adjustment %s after %s (%d accepted): cost %.6g -> %.6g, decrement %.2e",
                kOutcomes[static_cast<int>(state.outcome)], counted(state.iterations, "iteration").c_str(),
                state.accepted, state.initial_cost, state.cost, std::sqrt(state.decrement_squared));
  return line;
}

}  // namespace megablock
