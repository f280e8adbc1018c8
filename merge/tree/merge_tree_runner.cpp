// Gives every node of the merge tree its plan and its rank, and finds the datum of the block.
//
// Only small things are gathered on all ranks: the unknowns of every tile, from which each rank makes the same plan of
// the tree, and the parts of the datum (GaugePart), from which each makes the same datum.
#include "merge/tree/merge_tree_runner.h"

#include <algorithm>
#include <utility>

#include "merge/tree/gather_by_tile.h"

namespace megablock {

std::vector<int> distribute_tiles(const MergeTree& tree, const std::vector<std::int64_t>& observations, int ranks) {
  std::int64_t total = 0;
  // One more for each tile, so that tiles without observations are shared out, too.
  for (const std::int64_t count : observations) total += count + 1;
  std::vector<int> rank_of_tile(observations.size(), 0);
  std::int64_t before = 0;
  for (const MergeTree::Node& node : tree.nodes) {
    if (!node.tile.valid()) continue;
    const auto tile = static_cast<std::size_t>(node.tile.value);
    // A tile goes to the rank in whose share of the sum its middle lies.
    const std::int64_t middle = before + (observations[tile] + 1) / 2;
    rank_of_tile[tile] = static_cast<int>(std::min<std::int64_t>(ranks - 1, middle * ranks / total));
    before += observations[tile] + 1;
  }
  return rank_of_tile;
}

MergeTreeRunner::MergeTreeRunner(TreeCommunicator& ranks, const MergeTree& tree, std::vector<int> rank_of_tile,
                                 TileStore& tiles, const MemoryOptions& memory, const NodeSolver& solver)
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

MergeTreeRunner::~MergeTreeRunner() = default;

void MergeTreeRunner::make_plans(const MergeTree& tree, std::size_t tile_count) {
  std::vector<UnknownList> own;
  // Each tile is read twice here: the plan of a tile needs the plan of the tree, and that needs the unknowns of all
  // tiles.
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
    if (node.leaf >= 0) node.eliminated = node.owned = {};  // the plans of the tiles have these lists
}

double MergeTreeRunner::seam_probability() const {
  const auto inner =
      std::count_if(plan_.nodes.begin(), plan_.nodes.end(), [](const PlanNode& n) { return n.leaf < 0; });
  return kSeamAlarmProbability / static_cast<double>(std::max<std::ptrdiff_t>(1, inner));
}

void MergeTreeRunner::find_gauges() {
  gauges_.clear();
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.whole(row);
    gauges_.push_back(tile_gauge(tile.problem, tile_plans_[row], tile.state));
  }
}

BlockGauge MergeTreeRunner::gather_gauge() const {
  return make_gauge(gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, gauges_), held_before_);
}

TileDatum MergeTreeRunner::datum_of(std::size_t row) const {
  const RankTile& tile = tiles_.outline(row);
  TileDatum datum = tile_datum(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, columns_);
  datum.spread = with_scores_ ? 0 : spread_share_;
  if (with_scores_) datum.clusters = &cluster_weights_;
  if (columns_ == DatumColumns::kFrames) datum.columns = unit_columns(block_frames_, tile_plans_[row]);
  return datum;
}

InnerSums MergeTreeRunner::gather_inner_sums(const std::vector<TileStep>& steps) const {
  std::vector<InnerSums> own;
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.outline(row);
    own.push_back(inner_sums(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, steps[row].unknowns));
  }
  const std::vector<InnerSums> all = gather_by_tile(ranks_, plan_.node_of_leaf.size(), tiles_, own);
  // Every rank sums in the order of the tiles.
  InnerSums sums = all.front();
  for (std::size_t t = 1; t < all.size(); ++t) sums.add(all[t]);
  return sums;
}

CovarianceMatrix MergeTreeRunner::frame_covariance_of_small_block() {
  std::int64_t frames = 0;
  for (const BlockComponent& c : gauge_.components) frames += c.frames;
  // The sum counts a frame once for each of its tiles.
  if (frames > 2 * kMostFramesWithCovariances) return {};
  std::vector<UnknownList> own(tiles_.size());
  for (std::size_t row = 0; row < tiles_.size(); ++row)
    for (const Unknown& u : tile_plans_[row].owned)
      if (u.id.kind == UnknownKind::kFrame) own[row].push_back(u);
  const std::size_t tiles = plan_.node_of_leaf.size();
  block_frames_.clear();
  for (const UnknownList& of_tile : gather_by_tile(ranks_, tiles, tiles_, own))
    block_frames_.insert(block_frames_.end(), of_tile.begin(), of_tile.end());
  std::ranges::sort(block_frames_);
  if (block_frames_.empty() || std::ssize(block_frames_) > kMostFramesWithCovariances) return {};

  // It is small and is not recorded.
  SweepRecorder* const recorder = std::exchange(recorder_, nullptr);
  columns_ = DatumColumns::kFrames;
  condense_all(0);
  const std::vector<TileStep> steps = steps_down(0);
  std::vector<FrameColumns> columns;
  for (std::size_t row = 0; row < tiles_.size(); ++row) {
    const RankTile& tile = tiles_.outline(row);
    columns.push_back(
        frame_columns(gauge_, tile.tile, tile.problem, tile_plans_[row], tile.state, steps[row].unknowns));
  }
  columns_ = DatumColumns::kNone;
  recorder_ = recorder;
  return frame_covariance(gauge_, block_frames_, gather_by_tile(ranks_, tiles, tiles_, columns));
}

bool MergeTreeRunner::mine(std::int64_t node) const {
  return rank_of_node_[static_cast<std::size_t>(node)] == ranks_.rank();
}

}  // namespace megablock
