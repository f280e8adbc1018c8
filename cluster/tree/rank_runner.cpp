#include "cluster/tree/rank_runner.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "cluster/mpi/gather_by_tile.h"
#include "cluster/process/progress.h"
#include "geometry/threads/rounds.h"
#include "io/base/error.h"
#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

// Adds the time of its life to a sum.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum) : sum_(sum), start_(monotonic_seconds()) {}
  ~Stopwatch() { sum_ += monotonic_seconds() - start_; }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& sum_;
  const double start_;
};

}  // namespace

std::vector<int> distribute_tiles(const MergeTree& tree, const std::vector<std::int64_t>& observations, int ranks) {
  std::int64_t total = 0;
  for (const std::int64_t count : observations) total += count + 1;
  std::vector<int> rank_of_tile(observations.size(), 0);
  std::int64_t before = 0;
  for (const MergeTree::Node& node : tree.nodes) {
    if (!node.tile.valid()) continue;
    const auto tile = static_cast<std::size_t>(node.tile.value);
    const std::int64_t middle = before + (observations[tile] + 1) / 2;
    rank_of_tile[tile] = static_cast<int>(std::min<std::int64_t>(ranks - 1, middle * ranks / total));
    before += observations[tile] + 1;
  }
  return rank_of_tile;
}

RankRunner::RankRunner(Communicator& ranks, const MergeTree& tree, std::vector<int> rank_of_tile, TileStore& tiles,
                       const MemoryOptions& memory, const NodeSolver& solver)
    : ranks_(ranks), tiles_(tiles), solver_(solver), tile_plans_(memory.scratch), factors_(memory) {
  rank_of_node_.assign(tree.nodes.size(), 0);
  own_tile_of_node_.assign(tree.nodes.size(), -1);
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    const MergeTree::Node& node = tree.nodes[n];
    rank_of_node_[n] = node.tile.valid() ? rank_of_tile[static_cast<std::size_t>(node.tile.value)]
                                         : rank_of_node_[static_cast<std::size_t>(node.left)];
    for (std::size_t i = 0; i < tiles_.size(); ++i)
      if (node.tile.valid() && tiles_.number(i) == node.tile.value) own_tile_of_node_[n] = static_cast<std::int64_t>(i);
  }
  make_plans(tree, rank_of_tile.size());
  find_gauges();
}

RankRunner::~RankRunner() = default;

void RankRunner::make_plans(const MergeTree& tree, std::size_t tile_count) {
  std::vector<UnknownList> own;
  for (std::size_t row = 0; row < tiles_.size(); ++row) own.push_back(tile_unknowns(tiles_.whole(row).problem));
  plan_ = make_plan(tree, gather_by_tile(ranks_, tile_count, tiles_, own));
  on_one_rank_.assign(plan_.nodes.size(), false);
  for (std::size_t n = 0; n < plan_.nodes.size(); ++n) {
    const PlanNode& node = plan_.nodes[n];
    on_one_rank_[n] =
        mine(static_cast<std::int64_t>(n)) && (node.leaf >= 0 || (on_one_rank_[static_cast<std::size_t>(node.left)] &&
                                                                  on_one_rank_[static_cast<std::size_t>(node.right)]));
  }
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const std::int64_t node = plan_.node_of_leaf[static_cast<std::size_t>(tiles_.number(row))];
    tile_plans_.add(tiles_.number(row),
                    make_tile_plan(tiles_.whole(row).problem, plan_.nodes[static_cast<std::size_t>(node)]),
                    tiles_.in_scratch(row));
  }
  for (PlanNode& node : plan_.nodes)
    if (node.leaf >= 0) node.eliminated = node.owned = {};  // the tiles' own plans have it
}

double RankRunner::seam_probability() const {
  const auto inner =
      std::count_if(plan_.nodes.begin(), plan_.nodes.end(), [](const PlanNode& n) { return n.leaf < 0; });
  return kSeamAlarmProbability / static_cast<double>(std::max<std::ptrdiff_t>(1, inner));
}

void RankRunner::find_gauges() {
  gauges_.clear();
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.whole(row);
    gauges_.push_back(tile_gauge(tile.problem, tile_plans_[row], tile.state));
  }
}

BlockGauge RankRunner::gather_gauge() const {
  return make_gauge(gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, gauges_));
}

TileDatum RankRunner::datum_of(std::size_t row) const {
  const RankTile& tile = tiles_.outline(row);
  return tile_datum(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, with_columns_);
}

InnerSums RankRunner::gather_inner_sums(const std::vector<TileStep>& steps) const {
  std::vector<InnerSums> own;
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.outline(row);
    own.push_back(inner_sums(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, steps[row].unknowns));
  }
  const std::vector<InnerSums> all = gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, own);
  InnerSums sums = all.front();
  for (std::size_t t = 1; t < all.size(); ++t) sums.add(all[t]);
  return sums;
}

bool RankRunner::mine(std::int64_t node) const {
  return rank_of_node_[static_cast<std::size_t>(node)] == ranks_.rank();
}

void RankRunner::pass_up(std::int64_t node, UpdateMatrix update) {
  const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(node)].parent;
  if (parent < 0 || mine(parent)) {
    updates_[node] = std::move(update);
  } else {
    ranks_.send(rank_of_node_[static_cast<std::size_t>(parent)], static_cast<int>(node), update.to_bytes());
  }
}

UpdateMatrix RankRunner::child_update(std::int64_t child) {
  if (!mine(child))
    return UpdateMatrix::from_bytes(
        ranks_.receive(rank_of_node_[static_cast<std::size_t>(child)], static_cast<int>(child)));
  UpdateMatrix update = std::move(updates_.at(child));
  updates_.erase(child);
  return update;
}

UpdateMatrix RankRunner::keep(std::int64_t leaf, TileCondensation condensed) {
  if (check_seams_) condensed.update.alone = least_squares(condensed.update);
  factors_.put(leaf, {std::move(condensed.factor), {}, check_seams_ ? condensed.update : UpdateMatrix()},
               FactorStore::Loss::kRecompute);
  return std::move(condensed.update);
}

UpdateMatrix RankRunner::eliminate_inner(std::int64_t node, UpdateMatrix left, UpdateMatrix right, const Pass& pass,
                                         bool check_seam_here) {
  const auto n = static_cast<std::size_t>(node);
  const Stopwatch watch(seconds_.fronts);
  const LeastSquares left_alone = left.alone, right_alone = right.alone;
  Front::Result result = solver_.eliminate(plan_.nodes[n], std::move(left), std::move(right), pass.lambda);
  if (check_seam_here) {
    result.update.alone = least_squares(result.update);
    seams_.push_back(check_seam(node, left_alone, right_alone, result, seam_probability()));
  }
  factors_.put(node, {{}, std::move(result.factor)},
               on_one_rank_[n] ? FactorStore::Loss::kRecompute : FactorStore::Loss::kNever);
  return std::move(result.update);
}

UpdateMatrix RankRunner::condense_again(std::int64_t node, const Pass& pass) {
  const PlanNode& plan = plan_.nodes[static_cast<std::size_t>(node)];
  if (plan.leaf >= 0) {
    const Stopwatch watch(seconds_.tiles);
    const std::size_t row = row_of_leaf(node);
    const RankTile& tile = tiles_.whole(row);
    return keep(node, condense_tile(tile.problem, tile_plans_[row], tile.state, pass, datum_of(row)));
  }
  UpdateMatrix left = condense_again(plan.left, pass), right = condense_again(plan.right, pass);
  return eliminate_inner(node, std::move(left), std::move(right), pass, false);
}

// The eliminated columns, and the rest once whole and once as a triangle; of the covariances as much. A seam's check
// works on a copy of the rest. What a tile eliminates never stands in one front: its cells' fronts are small.
std::int64_t RankRunner::front_bytes(std::int64_t node) const {
  const PlanNode& plan = plan_.nodes[static_cast<std::size_t>(node)];
  const std::int64_t e = total_dimension(plan.eliminated), p = total_dimension(plan.passed);
  const std::int64_t rests = check_seams_ ? 2 : 1;
  return static_cast<std::int64_t>(sizeof(double)) * ((e + p) * e + rests * p * p + p * p / 2);
}

std::int64_t RankRunner::waiting_bytes() const {
  std::int64_t bytes = 0;
  for (const auto& [node, update] : updates_) bytes += update.byte_count();
  for (const auto& [node, values] : downward_) bytes += static_cast<std::int64_t>(values.size());
  return bytes;
}

const NodeFactors& RankRunner::factors_of(std::int64_t node, const Pass& pass) {
  if (const NodeFactors* kept = factors_.get(node)) return *kept;
  factors_.note_recomputed();
  condense_again(node, pass);
  return *factors_.get(node);
}

UpReport RankRunner::up(const Pass& pass) {
  const Stopwatch watch(seconds_.all);
  ++seconds_.passes;
  // Of the state at hand, not of the first one: a resumed run gets the same bits.
  gauge_ = gather_gauge();
  last_pass_.reset();
  check_seams_ = posterior_expected_ && pass.lambda == 0 && !pass.curvature && !gauge_.free();
  const UpReport report = condense_all(pass);
  if (check_seams_) last_pass_ = report.sums;
  check_seams_ = false;
  return report;
}

std::vector<bool> RankRunner::nodes_of(const std::vector<std::int64_t>& subtrees) const {
  std::vector<bool> nodes(plan_.nodes.size(), false);
  for (const std::int64_t top : subtrees) nodes[static_cast<std::size_t>(top)] = true;
  for (std::int64_t n = plan_.root(); n >= 0; --n) {
    const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(n)].parent;
    if (parent >= 0 && nodes[static_cast<std::size_t>(parent)]) nodes[static_cast<std::size_t>(n)] = true;
  }
  return nodes;
}

bool RankRunner::leaves(std::int64_t node) const {
  const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(node)].parent;
  return parent < 0 || !on_one_rank_[static_cast<std::size_t>(parent)];
}

std::vector<bool> RankRunner::go_on(const PassRecord& record) {
  factors_.adopt(record.factors);
  seams_ = record.seams;
  std::ranges::copy_if(record.subtrees, std::back_inserter(left_), [&](std::int64_t n) { return leaves(n); });
  return nodes_of(record.subtrees);
}

void RankRunner::record(std::int64_t node, const UpdateMatrix& update) {
  if (recorder_ == nullptr || !on_one_rank_[static_cast<std::size_t>(node)]) return;
  const std::int64_t bytes = update.byte_count() + waiting_bytes() + factors_.bytes_without_copy();
  if (!recorder_->due(bytes, leaves(node))) return;
  std::map<std::int64_t, const UpdateMatrix*> updates{{node, &update}};
  for (const auto& [n, waiting] : updates_)
    if (on_one_rank_[static_cast<std::size_t>(n)]) updates[n] = &waiting;
  if (!factors_.copy_to_scratch() || !recorder_->write_updates(updates)) return recorder_->give_up();
  if (leaves(node)) left_.push_back(node);

  PassRecord record;
  std::set<std::int64_t> subtrees(left_.begin(), left_.end());
  for (const auto& [n, waiting] : updates) subtrees.insert(n);
  record.subtrees.assign(subtrees.begin(), subtrees.end());
  const std::vector<bool> done = nodes_of(record.subtrees);
  for (std::size_t n = 0; n < done.size(); ++n) record.tiles += done[n] && plan_.nodes[n].leaf >= 0;
  const auto is_done = [&](std::int64_t n) { return done[static_cast<std::size_t>(n)]; };
  std::ranges::copy_if(factors_.nodes_in_scratch(), std::back_inserter(record.factors), is_done);
  std::ranges::copy_if(seams_, std::back_inserter(record.seams), is_done, &SeamReport::node);
  recorder_->write(std::move(record));
}

void RankRunner::hand_on(std::int64_t node, UpdateMatrix update) {
  record(node, update);
  pass_up(node, std::move(update));
}

UpdateMatrix RankRunner::join_children(std::int64_t n, const Pass& pass) {
  const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
  UpdateMatrix left = child_update(node.left), right = child_update(node.right);
  const std::int64_t at_work = waiting_bytes() + left.byte_count() + right.byte_count() + front_bytes(n);
  peak_front_bytes_ = std::max(peak_front_bytes_, at_work);
  factors_.leave_room(at_work);
  return eliminate_inner(n, std::move(left), std::move(right), pass, check_seams_);
}

// Records, messages and fronts above the tiles come one after the other, in the order of the nodes; meanwhile other
// threads are ahead at the next tile.
void RankRunner::condense_tiles(std::span<const std::int64_t> leaves, const Pass& pass, const TakeCondensation& take) {
  std::vector<std::unique_ptr<TileCondenser>> tiles(leaves.size());
  double elsewhere = 0;
  const auto prepare = [&](std::int64_t i) {
    const std::size_t row = row_of_leaf(leaves[at(i)]);
    const RankTile& tile = tiles_.whole(row);
    tiles[at(i)] = std::make_unique<TileCondenser>(tile.problem, tile_plans_[row], tile.state, pass, datum_of(row));
    return tiles[at(i)]->cells();
  };
  const auto finish = [&](std::int64_t i) {
    TileCondensation condensed = std::exchange(tiles[at(i)], nullptr)->take();
    const Stopwatch watch(elsewhere);
    take(at(i), std::move(condensed));
  };
  {
    const Stopwatch watch(seconds_.tiles);
    visit_in_rounds({std::ssize(leaves), prepare,
                     [&](std::int64_t i, std::int64_t cell) { tiles[at(i)]->condense(cell); }, finish,
                     [&](std::int64_t i) { return in_memory(row_of_leaf(leaves[at(i)])); }});
  }
  seconds_.tiles -= elsewhere;
}

UpReport RankRunner::condense_all(const Pass& pass) {
  updates_.clear();
  factors_.clear();
  seams_.clear();
  left_.clear();
  const PassRecord before = recorder_ ? recorder_->begin({pass, check_seams_, with_columns_}) : PassRecord();
  const std::vector<bool> done = go_on(before);
  std::vector<std::int64_t> leaves;
  for (std::int64_t n = 0; n < std::ssize(plan_.nodes); ++n)
    if (mine(n) && plan_.nodes[static_cast<std::size_t>(n)].leaf >= 0 && !done[static_cast<std::size_t>(n)])
      leaves.push_back(n);
  leaves.push_back(std::ssize(plan_.nodes));
  std::int64_t next = 0;  // node
  // What is between two tiles: nodes above tiles, and those that the record has.
  const auto go_on_to = [&](std::int64_t leaf) {
    for (; next < leaf; ++next) {
      if (!mine(next)) continue;
      if (!done[static_cast<std::size_t>(next)])
        hand_on(next, join_children(next, pass));
      else if (std::ranges::binary_search(before.subtrees, next))
        pass_up(next, recorder_->read_update(next));
    }
  };
  go_on_to(leaves.front());
  condense_tiles(std::span(leaves).first(leaves.size() - 1), pass, [&](std::size_t i, TileCondensation condensed) {
    factors_.leave_room(waiting_bytes());
    hand_on(next++, keep(leaves[i], std::move(condensed)));
    go_on_to(leaves[i + 1]);
  });
  ranks_.flush_sends();
  const std::int64_t root = plan_.root();
  const std::string at_root = mine(root) ? updates_.at(root).to_bytes() : std::string();
  updates_.clear();
  return {UpdateMatrix::from_bytes(ranks_.broadcast(at_root, rank_of_node_[static_cast<std::size_t>(root)])).sums};
}

// Messages of the two directions never mix: an upward pass has ended everywhere (its root is broadcast) before a
// downward one begins, and the other way round (its sums are gathered).
template <typename Values>
void RankRunner::pass_down(std::int64_t n, const Values& front) {
  const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
  for (const std::int64_t child : {node.left, node.right}) {
    Bytes bytes = front.bytes_of(plan_.nodes[static_cast<std::size_t>(child)].passed);
    if (mine(child))
      downward_[child] = std::move(bytes);
    else
      ranks_.send(rank_of_node_[static_cast<std::size_t>(child)], static_cast<int>(child), std::move(bytes));
  }
}

template <typename Values>
Values RankRunner::from_parent(std::int64_t n) {
  const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(n)].parent;
  if (parent < 0) return {};
  if (!mine(parent))
    return Values::from_bytes(ranks_.receive(rank_of_node_[static_cast<std::size_t>(parent)], static_cast<int>(n)));
  const Bytes bytes = std::move(downward_.at(n));
  downward_.erase(n);
  return Values::from_bytes(bytes);
}

std::vector<TileStep> RankRunner::steps_down(const Pass& pass) {
  std::vector<TileStep> steps(tiles_.size());
  for (std::int64_t n = plan_.root(); n >= 0; --n) {
    if (!mine(n)) continue;
    const Step passed = from_parent<Step>(n);
    const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
    const Stopwatch watch(node.leaf < 0 ? seconds_.fronts : seconds_.tiles);
    if (node.leaf < 0) {
      pass_down(n, solver_.back_substitute(factors_of(n, pass).front, passed));
      continue;
    }
    const std::size_t row = row_of_leaf(n);
    steps[row] = solve_tile_unknowns(tile_plans_[row], factors_of(n, pass).tile, passed);
  }
  ranks_.flush_sends();
  return steps;
}

void RankRunner::try_steps(const std::vector<BlockMotion>& motions, const Pass& pass,
                           const std::vector<TileStep>& steps, const TakeTrial& take) {
  const Stopwatch watch(seconds_.tiles);
  std::vector<std::unique_ptr<TileTrialMaker>> trials(tiles_.size());
  const auto prepare = [&](std::int64_t row) {
    const RankTile& tile = tiles_.whole(at(row));
    trials[at(row)] = std::make_unique<TileTrialMaker>(gauge_, motions, tile.tile, tile.problem, tile_plans_[at(row)],
                                                       tile.state, pass, steps[at(row)]);
    return trials[at(row)]->portions();
  };
  visit_in_rounds({std::ssize(trials), prepare,
                   [&](std::int64_t row, std::int64_t portion) { trials[at(row)]->visit(portion); },
                   [&](std::int64_t row) { take(at(row), std::exchange(trials[at(row)], nullptr)->take()); },
                   [&](std::int64_t row) { return in_memory(at(row)); }});
}

DownReport RankRunner::down(const Pass& pass) {
  struct Sums {
    double damping_norm = 0, trial_cost = 0;
  };
  const Stopwatch watch(seconds_.all);
  last_pass_.reset();  // factors that are computed again have not what the posterior needs
  std::vector<TileStep> steps = steps_down(pass);
  std::vector<MotionSums> own;
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.outline(row);
    own.push_back(motion_sums(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, steps[row].unknowns));
  }
  const std::vector<BlockMotion> motions =
      block_motions(gauge_, gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, own));
  std::vector<Sums> sums(tiles_.size());
  trial_gauges_.clear();
  try_steps(motions, pass, steps, [&](std::size_t row, TileTrial trial) {
    sums[row] = {trial.damping_norm, trial.cost};
    trial_gauges_.push_back(tile_gauge(tiles_.outline(row).problem, tile_plans_[row], trial.state));
    tiles_.put_trial(row, std::move(trial.state));
    steps[row] = {};
  });
  DownReport report;
  for (const Sums& tile : gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, sums)) {
    report.damping_norm += tile.damping_norm;
    report.trial_cost += tile.trial_cost;
  }
  return report;
}

void RankRunner::accept() {
  last_pass_.reset();
  tiles_.accept();
  gauges_ = std::move(trial_gauges_);
}

void RankRunner::reject() { tiles_.reject(); }

RankRunner::Posterior RankRunner::posterior(const VisitCovariance& visit) {
  Posterior posterior;
  check_seams_ = true;
  if (last_pass_) {
    posterior.sums = *std::exchange(last_pass_, std::nullopt);
  } else {
    find_gauges();  // states may have followed what other tiles moved
    gauge_ = gather_gauge();
    with_columns_ = gauge_.free();
    posterior.sums = condense_all(0).sums;
  }
  posterior.gauge = gauge_;
  std::vector<TileStep> steps(tiles_.size());
  InnerSums inner_constraints;
  if (with_columns_) {
    steps = steps_down(0);
    inner_constraints = gather_inner_sums(steps);
  }

  std::vector<TileCheck> checks(tiles_.size());
  std::vector<ObservationTable> tables(tiles_.size());
  for (std::int64_t n = plan_.root(); n >= 0; --n) {
    if (!mine(n)) continue;
    CovarianceMatrix passed = from_parent<CovarianceMatrix>(n);
    const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
    factors_.leave_room(waiting_bytes() + front_bytes(n));
    const NodeFactors& factors = factors_of(n, 0);
    if (node.leaf < 0) {
      const FrontCovariance covariance = solver_.covariance(factors.front, std::move(passed));
      factors_.discard(n);
      pass_down(n, covariance);
      continue;
    }
    const std::size_t row = row_of_leaf(n);
    const RankTile& tile = tiles_.whole(row);
    const TilePlan& plan = tile_plans_[row];
    const Step& step = steps[row].unknowns;
    checks[row] = check_tile(tile.tile, factors.condensed, passed, seam_probability());
    TileCovariance covariance =
        covariance_tile(tile.problem, plan, tile.state, factors.tile, std::move(passed), datum_of(row), step);
    factors_.discard(n);
    covariance.boundary = {};
    if (with_columns_)
      to_inner_constraints(gauge_, inner_constraints, tile.tile, tile.problem, plan, tile.state, step, covariance);
    tables[row] = covariance.observations;
    if (visit) visit(tile, covariance);
  }
  ranks_.flush_sends();
  with_columns_ = check_seams_ = false;
  posterior.tile_checks = gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, checks);
  for (const ObservationTable& table : gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, tables))
    posterior.observations.add(table);

  ByteWriter writer;
  writer.values(seams_);
  for (const Bytes& bytes : ranks_.gather_all(writer.take())) {
    ByteReader reader(bytes);
    const std::vector<SeamReport> some = reader.values<SeamReport>();
    posterior.seams.insert(posterior.seams.end(), some.begin(), some.end());
  }
  std::sort(posterior.seams.begin(), posterior.seams.end(),
            [](const SeamReport& a, const SeamReport& b) { return a.node < b.node; });
  return posterior;
}

}  // namespace megablock
