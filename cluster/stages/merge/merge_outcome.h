// What the adjusted block says of itself: covariances, figures, and each tile's part of the result.
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
  IndexedVector<FrameIndex, BlockResult::Matrix6> frame_covariance;
  IndexedVector<CameraIndex, Eigen::MatrixXd> camera_covariance;
  IndexedVector<RigIndex, std::vector<BlockResult::Matrix6>> mount_covariance;
  double chi2 = 0;
  std::int64_t degrees_of_freedom = 0;
  double variance_factor() const { return degrees_of_freedom > 0 ? chi2 / static_cast<double>(degrees_of_freedom) : 1; }
  double image_sigma_px = 0;  // of tie point measurements, as adjusted with
  int global_iterations = 0;
  double newton_decrement = 0;
  std::string gauge;
  std::vector<FreePart> free_parts;
  std::vector<SeamCheck> seams;
  ObservationTable observations;
};

// An adjusted block as a rank knows it.
struct Adjusted {
  MergeTreeRunner::Posterior posterior;
  std::vector<TilePart> parts;  // of this rank's tiles
  double image_sigma_px = 0;    // of tie point measurements
  MergePosition position;
  MergeCosts costs;  // of the last round
  BlockState state;
  bool converged = false;
};

// Files of a tile until the result is written: its tracks, and the covariances of what others may share with it. They
// lie with the checkpoints and go with them.
std::string part_path(const Job& job, std::int64_t tile);
std::string covariance_path(const Job& job, std::int64_t tile);

// Covariances at the solution; each tile's part of the result is written. `references` of the block's components.
// Collective.
void find_posterior(Job& job, const MergeInputs& inputs, const std::vector<MotionReference>& references,
                    MergeTreeRunner& runner, Adjusted& adjusted);

// All tiles' parts, on every rank; collective.
std::vector<TilePart> gather_parts(Job& job, const Adjusted& adjusted, std::size_t tile_count);

// What attitude priors alone tell of the orientation (common_motion.h), a line per case and part of the block.
std::vector<std::string> judge_motions(const Block& block, const Tiles& tiles, const std::vector<TilePart>& parts);

// Tiles of which most tie point measurements were rejected, less than half the share kept of all others', the worst
// first: what is left of them may agree by chance, with itself and with other tiles, and then no test of residuals or
// seams (merge/checks/seam_check.h) tells them. A line each, of three at most.
std::vector<std::string> judge_kept(const std::vector<TilePart>& parts);

// When all ranks have written their tiles' files, of which covariances are read: takes the state over.
MergeOutcome make_outcome(const Job& job, Adjusted& adjusted, const Tiles& tiles);

}  // namespace megablock
