// Gives the outcome of the global adjustment: covariances, figures, and the part of each tile in the result.
#pragma once

#include <string>
#include <vector>

#include "cluster/stages/merge/merge_checkpoint.h"
#include "cluster/stages/merge/merge_tiles.h"
#include "cluster/stages/result/result_parts.h"
#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// Figures of the merge that do not belong to a tile.
struct MergeOutcome {
  BlockState state;
  BlockResult::Empirical formal;     // without control points
  BlockResult::Empirical empirical;  // empty: not asked for
  double chi2 = 0;
  std::int64_t degrees_of_freedom = 0;
  double variance_factor() const { return degrees_of_freedom > 0 ? chi2 / static_cast<double>(degrees_of_freedom) : 1; }
  double image_sigma_px = 0;  // sigma of the tie point observations in the adjustment
  std::vector<PriorId> aside;
  int global_iterations = 0;
  double newton_decrement = 0;
  std::string gauge;
  std::vector<FreePart> free_parts;
  std::vector<SeamCheck> seams;
  ObservationTable observations;
  std::vector<PositionScale> position_scales;
};

// An adjusted block as one rank holds it.
struct Adjusted {
  MergeTreeRunner::Posterior posterior;
  CovarianceMatrix scored_frames;  // Posterior::frames with the scores of clusters
  std::vector<TilePart> parts;     // parts of the tiles of this rank
  PriorTests prior_tests;          // of the same tiles; empty where the datum is free
  double image_sigma_px = 0;       // sigma of the tie point observations
  MergePosition position;
  MergeCosts costs;  // costs of the last adjustment
  BlockState state;
  bool converged = false;
};

// Names the file that holds the tracks of a tile and the covariances of the unknowns that it may share, until the
// result is written. The files lie beside the checkpoints and are removed with them.
std::string part_path(const Job& job, std::int64_t tile);
std::string covariance_path(const Job& job, std::int64_t tile);
// The same with the scores of clusters, from which the empirical covariances follow (merge/tile/cluster_scores.h).
std::string scored_path(const Job& job, std::int64_t tile);

// Collective. Computes the covariances at the solution and writes each tile's part of the result. `references` are
// those of the block's components.
void find_posterior(const Job& job, const MergeInputs& inputs, const std::vector<MotionReference>& references,
                    MergeTreeRunner& runner, Adjusted& adjusted);

// Collective, after find_posterior(): writes each tile's covariances with the scores of clusters.
void find_empirical(const Job& job, MergeTreeRunner& runner, Adjusted& adjusted);

// Collective. The parts of all tiles, on every rank.
std::vector<TilePart> gather_parts(const Job& job, const Adjusted& adjusted, std::size_t tile_count);

// Names the parts of the orientation that only attitude priors determine (common_motion.h), one line for each case and
// part of the block.
std::vector<std::string> judge_motions(const Block& block, const Tiles& tiles, const std::vector<TilePart>& parts);

// Names tiles that keep less than half the share of observations that all others keep, the worst first, one line each,
// three at most. The few observations left may agree by chance, among themselves and with other tiles; no test of
// residuals or seams (merge/checks/seam_check.h) then finds such a tile.
std::vector<std::string> judge_kept(const std::vector<TilePart>& parts);

// Takes over the state when all ranks have written the files of their tiles, and reads the covariances from these
// files.
MergeOutcome make_outcome(const Job& job, Adjusted& adjusted, const Tiles& tiles);

}  // namespace megablock
