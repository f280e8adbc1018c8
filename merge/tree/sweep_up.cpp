// Sweeps up the tree: condenses tiles and eliminates fronts, children before parents.
//
// Nodes are numbered depth first, so that a front is eliminated as soon as both of its children are there. Few updates
// then wait at a time: those of the left siblings along one path to the root. Tiles take most of the time and are
// condensed by all threads; between two of them, one thread eliminates the fronts that have become complete.
#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include "geometry/threads/rounds.h"
#include "merge/plan/unknowns.h"
#include "merge/tree/merge_tree_runner.h"
#include "merge/tree/stopwatch.h"

namespace megablock {

// The tag of the message is the number of the child: each node has one update in a sweep.
void MergeTreeRunner::deliver_update(std::int64_t node, UpdateMatrix update) {
  const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(node)].parent;
  if (parent < 0 || mine(parent)) {
    updates_[node] = std::move(update);
  } else {
    ranks_.send(rank_of_node_[static_cast<std::size_t>(parent)], static_cast<int>(node), update.to_bytes());
  }
}

UpdateMatrix MergeTreeRunner::child_update(std::int64_t child) {
  if (!mine(child))
    return UpdateMatrix::from_bytes(
        ranks_.receive(rank_of_node_[static_cast<std::size_t>(child)], static_cast<int>(child)));
  UpdateMatrix update = std::move(updates_.at(child));
  updates_.erase(child);
  return update;
}

UpdateMatrix MergeTreeRunner::store_factors(std::int64_t leaf, TileCondensation condensed) {
  // The least squares of the tile alone are needed at the seam above; its condensed equations, on the way down, for the
  // check of the tile.
  if (check_seams_) condensed.update.alone = least_squares(condensed.update);
  factors_.put(leaf, {std::move(condensed.factor), {}, check_seams_ ? condensed.update : UpdateMatrix()},
               FactorStore::Loss::kRecompute);
  return std::move(condensed.update);
}

UpdateMatrix MergeTreeRunner::eliminate_inner(std::int64_t node, UpdateMatrix left, UpdateMatrix right,
                                              const Sweep& sweep, bool check_seam_here) {
  const auto n = static_cast<std::size_t>(node);
  const Stopwatch watch(seconds_.fronts);
  // They are taken out before the updates are moved into the front.
  const LeastSquares left_alone = left.alone, right_alone = right.alone;
  Front::Result result = solver_.eliminate(plan_.nodes[n], std::move(left), std::move(right), sweep.lambda);
  if (check_seam_here) {
    result.update.alone = least_squares(result.update);
    seams_.push_back(check_seam(node, left_alone, right_alone, result, seam_probability()));
  }
  factors_.put(node, {{}, std::move(result.factor)},
               on_one_rank_[n] ? FactorStore::Loss::kRecompute : FactorStore::Loss::kNever);
  return std::move(result.update);
}

// Goes down to the tiles, because the updates of the subtree are no longer there, and stores the factors of all its
// nodes on the way up. Seams were checked the first time.
UpdateMatrix MergeTreeRunner::condense_again(std::int64_t node, const Sweep& sweep) {
  const PlanNode& plan = plan_.nodes[static_cast<std::size_t>(node)];
  if (plan.leaf >= 0) {
    const Stopwatch watch(seconds_.tiles);
    const std::size_t row = row_of_leaf(node);
    const RankTile& tile = tiles_.whole(row);
    return store_factors(node, condense_tile(tile.problem, tile_plans_[row], tile.state, sweep, datum_of(row)));
  }
  UpdateMatrix left = condense_again(plan.left, sweep), right = condense_again(plan.right, sweep);
  return eliminate_inner(node, std::move(left), std::move(right), sweep, false);
}

// The memory of a front holds the eliminated columns, and the update once as a full matrix and once as a triangle. The
// check of a seam works on a copy of the update. The covariances need the larger of 2 e^2 and e^2 + 2 p e + p^2 values
// beside the factor, which is more than this where e is large. A tile has no front of all its unknowns, because its
// cells are eliminated in small fronts.
std::int64_t MergeTreeRunner::front_bytes(std::int64_t node) const {
  const PlanNode& plan = plan_.nodes[static_cast<std::size_t>(node)];
  const std::int64_t e = total_dimension(plan.eliminated), p = total_dimension(plan.separator);
  const std::int64_t rests = check_seams_ ? 2 : 1;
  return static_cast<std::int64_t>(sizeof(double)) * ((e + p) * e + rests * p * p + p * p / 2);
}

std::int64_t MergeTreeRunner::pending_update_bytes() const {
  std::int64_t bytes = 0;
  for (const auto& [node, update] : updates_) bytes += update.byte_count();
  for (const auto& [node, values] : downward_) bytes += static_cast<std::int64_t>(values.size());
  return bytes;
}

const NodeFactors& MergeTreeRunner::factors_of(std::int64_t node, const Sweep& sweep) {
  if (const NodeFactors* kept = factors_.get(node)) return *kept;
  factors_.note_recomputed();
  condense_again(node, sweep);
  // The factors that were stored last are always in memory.
  return *factors_.get(node);
}

UpReport MergeTreeRunner::up(const Sweep& sweep) {
  const Stopwatch watch(seconds_.all);
  ++seconds_.sweeps_up;
  // The datum belongs to the present state, not to the first one, so that a resumed run gets the same bits.
  held_before_ = sweep.held_before;
  gauge_ = gather_gauge();
  last_sweep_.reset();
  // A sweep that may be the last one checks its seams at once. The condition on the curvature is that of the
  // covariances: their weights are rho' alone.
  check_seams_ = posterior_expected_ && sweep.lambda == 0 && !sweep.curvature && !gauge_.free();
  UpReport report = condense_all(sweep);
  report.held = gauge_.against_priors();
  if (check_seams_) last_sweep_ = report.sums;
  check_seams_ = false;
  return report;
}

std::vector<bool> MergeTreeRunner::nodes_of(const std::vector<std::int64_t>& subtrees) const {
  std::vector<bool> nodes(plan_.nodes.size(), false);
  for (const std::int64_t top : subtrees) nodes[static_cast<std::size_t>(top)] = true;
  for (std::int64_t n = plan_.root(); n >= 0; --n) {
    const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(n)].parent;
    // Parents have higher numbers, so a parent is marked before its children.
    if (parent >= 0 && nodes[static_cast<std::size_t>(parent)]) nodes[static_cast<std::size_t>(n)] = true;
  }
  return nodes;
}

bool MergeTreeRunner::update_leaves(std::int64_t node) const {
  const std::int64_t parent = plan_.nodes[static_cast<std::size_t>(node)].parent;
  return parent < 0 || !on_one_rank_[static_cast<std::size_t>(parent)];
}

std::vector<bool> MergeTreeRunner::resume(const SweepRecord& record) {
  factors_.adopt(record.factors);
  seams_ = record.seams;
  std::ranges::copy_if(record.subtrees, std::back_inserter(sent_subtrees_),
                       [&](std::int64_t n) { return update_leaves(n); });
  return nodes_of(record.subtrees);
}

// The factors must be in scratch before the record names them. Updates that wait are written beside it.
void MergeTreeRunner::record(std::int64_t node, const UpdateMatrix& update) {
  // Only subtrees of this rank alone can be resumed without the other ranks.
  if (recorder_ == nullptr || !on_one_rank_[static_cast<std::size_t>(node)]) return;
  const std::int64_t bytes = update.byte_count() + pending_update_bytes() + factors_.bytes_without_copy();
  if (!recorder_->due(bytes, update_leaves(node))) return;
  // The tops of all finished subtrees: this node, the nodes that wait for their parents, and those whose updates have
  // left this rank's own subtrees.
  std::map<std::int64_t, const UpdateMatrix*> updates{{node, &update}};
  for (const auto& [n, waiting] : updates_)
    if (on_one_rank_[static_cast<std::size_t>(n)]) updates[n] = &waiting;
  if (!factors_.copy_to_scratch() || !recorder_->write_updates(updates)) return recorder_->give_up();
  if (update_leaves(node)) sent_subtrees_.push_back(node);

  SweepRecord record;
  std::set<std::int64_t> subtrees(sent_subtrees_.begin(), sent_subtrees_.end());
  for (const auto& [n, waiting] : updates) subtrees.insert(n);
  record.subtrees.assign(subtrees.begin(), subtrees.end());
  const std::vector<bool> done = nodes_of(record.subtrees);
  for (std::size_t n = 0; n < done.size(); ++n) record.tiles += done[n] && plan_.nodes[n].leaf >= 0;
  const auto is_done = [&](std::int64_t n) { return done[static_cast<std::size_t>(n)]; };
  std::ranges::copy_if(factors_.nodes_in_scratch(), std::back_inserter(record.factors), is_done);
  std::ranges::copy_if(seams_, std::back_inserter(record.seams), is_done, &SeamReport::node);
  recorder_->write(std::move(record));
}

void MergeTreeRunner::send_update(std::int64_t node, UpdateMatrix update) {
  // The record comes first, because the delivery moves the update away.
  record(node, update);
  deliver_update(node, std::move(update));
}

UpdateMatrix MergeTreeRunner::join_children(std::int64_t n, const Sweep& sweep) {
  const PlanNode& node = plan_.nodes[static_cast<std::size_t>(n)];
  UpdateMatrix left = child_update(node.left), right = child_update(node.right);
  const std::int64_t at_work = pending_update_bytes() + left.byte_count() + right.byte_count() + front_bytes(n);
  peak_front_bytes_ = std::max(peak_front_bytes_, at_work);
  // What the front needs is taken from the budget of the factors, which go to scratch now if need be.
  factors_.leave_room(at_work);
  return eliminate_inner(n, std::move(left), std::move(right), sweep, check_seams_);
}

// One thread makes records, sends messages and eliminates the fronts of inner nodes, in the order of the nodes. The
// other threads work ahead on the next tile meanwhile.
void MergeTreeRunner::condense_tiles(std::span<const std::int64_t> leaves, const Sweep& sweep,
                                     const VisitCondensation& visit) {
  std::vector<std::unique_ptr<TileCondenser>> tiles(leaves.size());
  double elsewhere = 0;
  const auto prepare = [&](std::int64_t i) {
    const std::size_t row = row_of_leaf(leaves[at(i)]);
    const RankTile& tile = tiles_.whole(row);
    tiles[at(i)] = std::make_unique<TileCondenser>(tile.problem, tile_plans_[row], tile.state, sweep, datum_of(row));
    return tiles[at(i)]->cells();
  };
  const auto finish = [&](std::int64_t i) {
    TileCondensation condensed = std::exchange(tiles[at(i)], nullptr)->take();
    const Stopwatch watch(elsewhere);
    visit(at(i), std::move(condensed));
  };
  {
    const Stopwatch watch(seconds_.tiles);
    visit_in_rounds({std::ssize(leaves), prepare,
                     [&](std::int64_t i, std::int64_t cell) { tiles[at(i)]->condense(cell); }, finish,
                     [&](std::int64_t i) { return in_memory(row_of_leaf(leaves[at(i)])); }});
  }
  // The time that `finish` spent on inner nodes and messages is counted elsewhere.
  seconds_.tiles -= elsewhere;
}

UpReport MergeTreeRunner::condense_all(const Sweep& sweep) {
  updates_.clear();
  factors_.clear();
  seams_.clear();
  sent_subtrees_.clear();
  const SweepRecord before =
      recorder_ ? recorder_->begin({sweep, check_seams_, static_cast<std::int32_t>(columns_)}) : SweepRecord();
  const std::vector<bool> done = resume(before);
  std::vector<std::int64_t> leaves;
  for (std::int64_t n = 0; n < std::ssize(plan_.nodes); ++n)
    if (mine(n) && plan_.nodes[static_cast<std::size_t>(n)].leaf >= 0 && !done[static_cast<std::size_t>(n)])
      leaves.push_back(n);
  // A last number behind all nodes, up to which the inner nodes after the last tile are visited.
  leaves.push_back(std::ssize(plan_.nodes));
  std::int64_t next = 0;  // next node to visit
  // Handles the nodes between two tiles: inner nodes, and nodes that the record of a killed run has.
  const auto advance_to = [&](std::int64_t leaf) {
    for (; next < leaf; ++next) {
      if (!mine(next)) continue;
      if (!done[static_cast<std::size_t>(next)])
        send_update(next, join_children(next, sweep));
      else if (std::ranges::binary_search(before.subtrees, next))
        deliver_update(next, recorder_->read_update(next));
    }
  };
  advance_to(leaves.front());
  condense_tiles(std::span(leaves).first(leaves.size() - 1), sweep, [&](std::size_t i, TileCondensation condensed) {
    factors_.leave_room(pending_update_bytes());
    send_update(next++, store_factors(leaves[i], std::move(condensed)));
    advance_to(leaves[i + 1]);
  });
  ranks_.flush_sends();
  const std::int64_t root = plan_.root();
  // The update of the root has no unknowns left. Its sums are those of the whole block; every rank decides on them
  // alike.
  const std::string at_root = mine(root) ? updates_.at(root).to_bytes() : std::string();
  updates_.clear();
  return {UpdateMatrix::from_bytes(ranks_.broadcast(at_root, rank_of_node_[static_cast<std::size_t>(root)])).sums};
}

}  // namespace megablock
