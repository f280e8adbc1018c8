#include "merge/tree/serial_runner.h"

#include "io/base/error.h"
#include "merge/plan/unknowns.h"
#include "merge/tile/point_refinement.h"

namespace megablock {

SerialRunner::SerialRunner(const MergeTree& tree, std::vector<TileProblem> problems, std::vector<TileState> states,
                           MemoryOptions memory, const NodeSolver& solver)
    : problems_(std::move(problems)), states_(std::move(states)), factors_(std::move(memory)), solver_(solver) {
  std::vector<UnknownList> lists;
  for (const TileProblem& problem : problems_) lists.push_back(tile_unknowns(problem));
  plan_ = make_plan(tree, lists);
  for (std::size_t t = 0; t < problems_.size(); ++t)
    tile_plans_.push_back(make_tile_plan(problems_[t], plan_.nodes[at(plan_.node_of_leaf[t])]));
  steps_.resize(problems_.size());
}

SerialRunner::~SerialRunner() = default;

std::int64_t SerialRunner::seam_count() const {
  std::int64_t count = 0;
  for (const PlanNode& node : plan_.nodes) count += node.leaf < 0;
  return count;
}

UpdateMatrix SerialRunner::condense_subtree(std::int64_t number, const Pass& pass, bool check_seams) {
  const PlanNode& node = plan_.nodes[at(number)];
  NodeFactors factors;
  UpdateMatrix update;
  if (node.leaf >= 0) {
    const std::size_t t = at(node.leaf);
    TileCondensation condensed = condense_tile(problems_[t], tile_plans_[t], states_[t], pass, datum_of(t));
    update = std::move(condensed.update);
    if (check_seams) update.alone = least_squares(update);
    factors.tile = std::move(condensed.factor);
  } else {
    UpdateMatrix left = condense_subtree(node.left, pass, check_seams);
    UpdateMatrix right = condense_subtree(node.right, pass, check_seams);
    const LeastSquares left_alone = left.alone, right_alone = right.alone;
    Front::Result result = solver_.eliminate(node, std::move(left), std::move(right), pass.lambda);
    if (check_seams) {
      result.update.alone = least_squares(result.update);
      seams_.push_back(check_seam(number, left_alone, right_alone, result,
                                  kSeamAlarmProbability / static_cast<double>(seam_count())));
    }
    update = std::move(result.update);
    factors.front = std::move(result.factor);
  }
  factors_.put(number, std::move(factors));
  return update;
}

BlockGauge SerialRunner::find_gauge() const {
  std::vector<TileGauge> gauges;
  for (std::size_t t = 0; t < problems_.size(); ++t)
    gauges.push_back(tile_gauge(problems_[t], tile_plans_[t], states_[t]));
  return make_gauge(gauges);
}

TileDatum SerialRunner::datum_of(std::size_t t) const {
  return tile_datum(block_gauge_, static_cast<std::int64_t>(t), problems_[t], tile_plans_[t], states_[t],
                    with_columns_);
}

UpReport SerialRunner::run_up(const Pass& pass, bool final_pass) {
  factors_.clear();
  // Of the state at hand, not of the first one: a resumed run gets the same bits.
  block_gauge_ = find_gauge();
  with_columns_ = final_pass && block_gauge_.free();
  if (final_pass) seams_.clear();
  return {condense_subtree(plan_.root(), pass, final_pass).sums};
}

UpReport SerialRunner::up(const Pass& pass) { return run_up(pass, false); }

UpReport SerialRunner::final_up() {
  const UpReport report = run_up(0, true);
  gauge_ = judge_gauge(report.sums, block_gauge_);
  return report;
}

const NodeFactors& SerialRunner::inner_factor(std::int64_t node, const Pass& pass) {
  if (const NodeFactors* kept = factors_.get(node)) return *kept;
  factors_.note_recomputed();
  condense_subtree(node, pass, false);
  return *factors_.get(node);
}

void SerialRunner::down_from(std::int64_t number, const Pass& pass, const Step& parent) {
  const PlanNode& node = plan_.nodes[at(number)];
  if (node.leaf >= 0) {
    const std::size_t t = at(node.leaf);
    steps_[t] =
        solve_tile_down(problems_[t], tile_plans_[t], states_[t], pass, inner_factor(number, pass).tile, parent);
    return;
  }
  const Step step = solver_.back_substitute(inner_factor(number, pass).front, parent);
  down_from(node.right, pass, step);
  down_from(node.left, pass, step);
}

DownReport SerialRunner::down(const Pass& pass) {
  down_from(plan_.root(), pass, Step());
  std::vector<MotionSums> sums;
  for (std::size_t t = 0; t < problems_.size(); ++t)
    sums.push_back(motion_sums(block_gauge_, static_cast<std::int64_t>(t), problems_[t], tile_plans_[t], states_[t],
                               steps_[t].unknowns));
  const std::vector<BlockMotion> motions = block_motions(block_gauge_, sums);
  trial_.clear();
  DownReport report;
  for (std::size_t t = 0; t < problems_.size(); ++t) {
    trial_.push_back(apply_step(block_gauge_, motions, static_cast<std::int64_t>(t), problems_[t], tile_plans_[t],
                                states_[t], steps_[t]));
    report.damping_norm += steps_[t].damping_norm;
    report.trial_cost += refine_points(problems_[t], tile_plans_[t], trial_.back());
  }
  return report;
}

void SerialRunner::accept() { states_ = std::move(trial_); }

void SerialRunner::reject() { trial_.clear(); }

void SerialRunner::covariances_from(std::int64_t number, CovarianceMatrix passed, std::vector<TileCovariance>& result) {
  const PlanNode& node = plan_.nodes[at(number)];
  if (node.leaf >= 0) {
    const std::size_t t = at(node.leaf);
    const TileFactor& factor = inner_factor(number, 0).tile;
    result[t] = covariance_tile(problems_[t], tile_plans_[t], states_[t], factor, std::move(passed), datum_of(t),
                                with_columns_ ? steps_[t].unknowns : Step{});
    return;
  }
  const FrontCovariance covariance = solver_.covariance(inner_factor(number, 0).front, std::move(passed));
  for (const std::int64_t child : {node.right, node.left})
    covariances_from(child, covariance.restricted_to(plan_.nodes[at(child)].passed), result);
}

std::vector<TileCovariance> SerialRunner::covariances() {
  std::vector<TileCovariance> result(problems_.size());
  if (with_columns_) down_from(plan_.root(), 0, Step());
  covariances_from(plan_.root(), CovarianceMatrix{}, result);
  if (with_columns_) inner_constraints(result);
  return result;
}

std::vector<TileCheck> SerialRunner::tile_checks() {
  const double probability = kSeamAlarmProbability / static_cast<double>(problems_.size());
  std::vector<TileCovariance> all(problems_.size());
  covariances_from(plan_.root(), CovarianceMatrix{}, all);
  std::vector<TileCheck> checks;
  for (std::size_t t = 0; t < problems_.size(); ++t) {
    const UpdateMatrix condensed = condense_tile(problems_[t], tile_plans_[t], states_[t], 0, datum_of(t)).update;
    checks.push_back(check_tile(static_cast<std::int64_t>(t), condensed, all[t].boundary, probability));
  }
  return checks;
}

void SerialRunner::inner_constraints(std::vector<TileCovariance>& covariances) {
  InnerSums sums;
  for (std::size_t t = 0; t < problems_.size(); ++t) {
    const InnerSums part = inner_sums(block_gauge_, static_cast<std::int64_t>(t), problems_[t], tile_plans_[t],
                                      states_[t], steps_[t].unknowns);
    if (t == 0)
      sums = part;
    else
      sums.add(part);
  }
  for (std::size_t t = 0; t < problems_.size(); ++t)
    to_inner_constraints(block_gauge_, sums, static_cast<std::int64_t>(t), problems_[t], tile_plans_[t], states_[t],
                         steps_[t].unknowns, covariances[t]);
}

}  // namespace megablock
