// Runs the sweeps over the merge tree of a block, on any number of ranks.
//
// Each rank condenses its own tiles. The rank of the left child eliminates an inner node. A sweep up sends the updates
// of the children to their parents; a sweep down sends steps, or covariances, from parents to children. Where parent
// and child are on different ranks these values travel as messages (tree_communicator.h). All sums are formed in the
// order of the tiles or of the children, so that the bits do not depend on the ranks.
//
// No two ranks wait for each other. A rank visits its nodes by ascending number in a sweep up and by descending number
// in a sweep down, and children have lower numbers than their parents. Of all nodes that are not done, the first in
// this order has its values: they were sent when the nodes before it were done, because send() returns at once. Its
// rank has come to it, and goes on.
//
// Tiles lie in a store of their own, partly out of core (merge/step/tile_store.h), and a sweep asks once for each whole
// tile. Factors wait for the sweep down in memory; beyond the budget they wait in the scratch directory of the rank,
// and without room there they are computed again (merge/step/memory.h). The factors of a node whose subtree lies on
// several ranks are never dropped, because to compute them again would need the other ranks.
//
// The code is in merge_tree_runner.cpp (plans and datum), sweep_up.cpp, sweep_down.cpp and posterior.cpp.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "merge/checks/seam_check.h"
#include "merge/datum/inner_constraints.h"
#include "merge/plan/plan_store.h"
#include "merge/step/block_motion.h"
#include "merge/step/memory.h"
#include "merge/step/tile_store.h"
#include "merge/step/tile_trial.h"
#include "merge/tile/condense.h"
#include "merge/tree/global_adjustment.h"
#include "merge/tree/node.h"
#include "merge/tree/sweep_recorder.h"
#include "merge/tree/tree_communicator.h"

namespace megablock {

// Wall clock of this rank in the sweeps up and down of the iterations, seconds; those of the posterior do not count.
struct SweepSeconds {
  double tiles = 0;   // work on its tiles
  double fronts = 0;  // work on the fronts of inner nodes
  double all = 0;     // everything, including the time spent waiting for other ranks
  std::int64_t sweeps_up = 0;
};

// Gives every rank a contiguous run of tiles in the order of the leaves of the tree, balanced by observations, so that
// neighbours are on one rank. Returns the rank of each tile.
std::vector<int> distribute_tiles(const MergeTree& tree, const std::vector<std::int64_t>& observations, int ranks);

// The covariances between frames grow with the square of their number: these need 4.7 MB.
inline constexpr std::int64_t kMostFramesWithCovariances = 128;

class MergeTreeRunner : public TreeRunner {
 public:
  // Collective. `tiles` holds the tiles of this rank, ascending; `rank_of_tile` lists all tiles. `tiles` and `solver`
  // outlive the runner.
  MergeTreeRunner(TreeCommunicator& ranks, const MergeTree& tree, std::vector<int> rank_of_tile, TileStore& tiles,
                  const MemoryOptions& memory, const NodeSolver& solver = dense_node_solver());
  ~MergeTreeRunner() override;

  UpReport up(const Sweep& sweep) override;
  DownReport down(const Sweep& sweep) override;
  void accept() override;
  void reject() override;

  // Records sweeps up from now on. The first sweep resumes where the record of a killed run ends. A record holds
  // subtrees that are on this rank alone; nodes that join several ranks are computed again. `recorder` outlives the
  // runner.
  void record_sweeps(SweepRecorder& recorder) { recorder_ = &recorder; }

  // Says that the next sweep with lambda = 0 may be the last one. That sweep stores the data of the posterior, so that
  // the posterior needs no sweep of its own. This does not work for a block with a free datum, whose covariances need
  // further right-hand sides.
  void expect_posterior() { posterior_expected_ = true; }

  // Says before posterior() that scored_posterior() follows it. `share`: of the images that give Posterior::spread
  // (spread_share of merge/tile/cluster_scores.h).
  void expect_scores(double share) { spread_share_ = share; }

  // Collective, at the solution: runs a sweep up with lambda = 0, checks the seams, finds the datum and computes the
  // covariances.
  struct Posterior {
    SubtreeSums sums;  // of the whole block
    BlockGauge gauge;
    std::vector<SeamReport> seams;       // of all inner nodes, in node order; on every rank
    std::vector<TileCheck> tile_checks;  // of all tiles, in tile order; on every rank
    ObservationTable observations;       // of the whole block, on every rank
    // The covariance of all frames together, on every rank; of a free datum under inner constraints. Only for a block
    // of at most kMostFramesWithCovariances frames, else empty.
    CovarianceMatrix frames;
    ImageSpread spread;  // of the whole block, on every rank; where expect_scores() was called
  };
  // Calls `visit` once for each tile of this rank with its covariances, which are not stored.
  using VisitCovariance = std::function<void(const RankTile&, const TileCovariance&)>;
  Posterior posterior(const VisitCovariance& visit = {});
  // Collective, after posterior(): the empirical covariances in the same way (merge/tile/cluster_scores.h). `visit`
  // gets C(w), from which empirical_covariance() follows with the formal one. Returns C(w) of Posterior::frames.
  CovarianceMatrix scored_posterior(const VisitCovariance& visit);

  // The unknowns that occur in the kept residuals of a tile. The reference is valid until another tile is asked for.
  const UnknownList& unknowns(std::size_t row) const { return tile_plans_[row].unknowns; }
  const EliminationPlan& plan() const { return plan_; }
  const SweepSeconds& seconds() const { return seconds_; }
  const BlockGauge& gauge() const { return gauge_; }                             // of the last sweep up
  const TilePlan& tile_plan(std::size_t row) const { return tile_plans_[row]; }  // until another one is asked for
  // Called in down() with the step of each tile's unknowns, by row, before the trial state is formed.
  void on_step(std::function<void(std::size_t row, const Step&)> visit) { on_step_ = std::move(visit); }
  // The datum of a tile as the last sweep up took it.
  TileDatum datum_of(std::size_t row) const;
  const MemoryStatistics& memory() const { return factors_.statistics(); }
  // The largest memory of a front of an inner node, together with the updates of its children and all pending updates,
  // bytes.
  std::int64_t peak_front_bytes() const { return peak_front_bytes_; }

 private:
  bool mine(std::int64_t node) const;
  UpdateMatrix child_update(std::int64_t child);
  void deliver_update(std::int64_t node, UpdateMatrix update);
  // Sends each child its part of the values of a front; receives the values of a node from its parent (sweep_values.h).
  template <typename Values>
  void send_down(std::int64_t node, const Values& front);
  template <typename Values>
  Values from_parent(std::int64_t node);
  std::size_t row_of_leaf(std::int64_t leaf) const {  // row of this node's tile in tiles_
    return static_cast<std::size_t>(own_tile_of_node_[static_cast<std::size_t>(leaf)]);
  }
  // Whether the tile of this row and its plan stay in memory when another row is loaded. A tile may come back from
  // scratch while its plan stays there.
  bool in_memory(std::size_t row) const { return !tiles_.in_scratch(row) && !tile_plans_.in_scratch(row); }
  UpdateMatrix store_factors(std::int64_t leaf,
                             TileCondensation condensed);  // stores its factors and returns its update
  // Condenses the tiles of these nodes, ascending, and calls `visit` for one tile after the other.
  using VisitCondensation = std::function<void(std::size_t i, TileCondensation)>;
  void condense_tiles(std::span<const std::int64_t> leaves, const Sweep& sweep, const VisitCondensation& visit);
  UpdateMatrix join_children(std::int64_t node, const Sweep& sweep);
  void send_update(std::int64_t node, UpdateMatrix update);  // records it as well
  UpdateMatrix eliminate_inner(std::int64_t node, UpdateMatrix left, UpdateMatrix right, const Sweep& sweep,
                               bool check_seam_here);
  // The bytes of the front of a node during its elimination or the sweep down; the bytes of all updates and values that
  // wait for a parent or a child.
  std::int64_t front_bytes(std::int64_t node) const;
  std::int64_t pending_update_bytes() const;
  // Condenses again the subtree of a node, which is on this rank alone.
  UpdateMatrix condense_again(std::int64_t node, const Sweep& sweep);
  const NodeFactors& factors_of(std::int64_t node, const Sweep& sweep);
  // Marks the nodes of these subtrees. The result has one entry for each node.
  std::vector<bool> nodes_of(const std::vector<std::int64_t>& subtrees) const;
  // Takes over the finished part of the sweep of a killed run. Returns the nodes that are done.
  std::vector<bool> resume(const SweepRecord& record);
  // Records the sweep after the front of a node is eliminated, if a record is due.
  void record(std::int64_t node, const UpdateMatrix& update);
  // Whether the parent of the node joins several ranks, or there is no parent: then the update leaves the subtrees of
  // this rank.
  bool update_leaves(std::int64_t node) const;
  // Runs a sweep up with the datum in gauge_.
  UpReport condense_all(const Sweep& sweep);
  void make_plans(const MergeTree& tree, std::size_t tile_count);
  void find_gauges();
  double seam_probability() const;  // of a false alarm at one seam
  BlockGauge gather_gauge() const;
  InnerSums gather_inner_sums(const std::vector<TileStep>& steps) const;
  // The covariances from the factors of the last sweep up, tile by tile; the separator is that of the tile under the
  // minimal constraints.
  using VisitTileCovariance =
      std::function<void(std::size_t row, const NodeFactors&, const CovarianceMatrix& separator)>;
  void covariances_down(const VisitTileCovariance& before, const VisitCovariance& visit);
  // The covariance of all frames together. Needs a sweep of its own. Empty for a large block.
  CovarianceMatrix frame_covariance_of_small_block();
  // Runs a sweep down with the present factors. Returns the steps of the unknowns of this rank's tiles, without points.
  std::vector<TileStep> steps_down(const Sweep& sweep);
  // Forms the trial states of these steps and calls `visit` for one tile after the other.
  using VisitTrial = std::function<void(std::size_t row, TileTrial)>;
  void try_steps(const std::vector<BlockMotion>& motions, const Sweep& sweep, const std::vector<TileStep>& steps,
                 const VisitTrial& visit);

  TreeCommunicator& ranks_;
  TileStore& tiles_;
  const NodeSolver& solver_;
  PlanStore tile_plans_;                          // the plans of tiles_
  std::vector<TileGauge> gauges_, trial_gauges_;  // [tiles_] at the present states, and at the trial states
  std::vector<int> rank_of_node_;
  std::vector<std::int64_t> own_tile_of_node_;  // row in tiles_; -1: no tile of this rank
  EliminationPlan plan_;
  std::vector<bool> on_one_rank_;                 // [nodes]: the whole subtree is this rank's
  FactorStore factors_;                           // of this rank's nodes
  std::map<std::int64_t, UpdateMatrix> updates_;  // waiting for their parent on this rank
  SweepRecorder* recorder_ = nullptr;
  std::vector<std::int64_t>
      sent_subtrees_;  // recorded subtrees of this sweep whose update has left this rank's own subtrees
  BlockGauge gauge_;
  HeldAgainstPriors held_before_;               // of the last sweep up
  ClusterWeights cluster_weights_;              // of the last posterior()
  double spread_share_ = 0;                     // 0: no scored_posterior() follows
  bool with_scores_ = false;                    // the sweep adds the scores of clusters
  DatumColumns columns_ = DatumColumns::kNone;  // the further right-hand sides of the sweep
  UnknownList block_frames_;                    // of the whole block, where columns_ is kFrames
  bool check_seams_ = false;
  bool posterior_expected_ = false;
  std::optional<SubtreeSums> last_sweep_;  // sums of a sweep at the present state that stored the data of the posterior
  std::vector<SeamReport> seams_;
  SweepSeconds seconds_;
  std::int64_t peak_front_bytes_ = 0;
  std::function<void(std::size_t, const Step&)> on_step_;
  std::map<std::int64_t, Bytes> downward_;  // values from a parent on this rank for its child
};

}  // namespace megablock
