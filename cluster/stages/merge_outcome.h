// What the adjusted block says of itself: covariances, figures, and each tile's part of the result.
#pragma once

#include <string>
#include <vector>

#include "cluster/rank_runner.h"
#include "cluster/stages/merge_checkpoint.h"
#include "cluster/stages/merge_tiles.h"
#include "cluster/stages/result_parts.h"

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

// Of the frames and mounts of a tile, zero where it does not touch one. A frame of several tiles has the same bits in
// all of them; a mount, too, unless parts of the block with a datum of their own share it.
struct PoseCovariances {
  std::int64_t tile = -1;
  std::vector<FrameIndex> frames;
  std::vector<BlockResult::Matrix6> of_frames;
  std::vector<MountId> mounts;
  std::vector<BlockResult::Matrix6> of_mounts;
};

// An adjusted block as a rank knows it.
struct Adjusted {
  RankRunner::Posterior posterior;
  std::vector<TilePart> parts;                                       // of this rank's tiles
  std::vector<PoseCovariances> covariances_of_tiles;                 // of the same, until they are gathered
  IndexedVector<FrameIndex, BlockResult::Matrix6> frame_covariance;  // of the block, when they are: on the first rank
  IndexedVector<CameraIndex, Eigen::MatrixXd> camera_covariance;     // of this rank's tiles; then of the block
  IndexedVector<RigIndex, std::vector<BlockResult::Matrix6>> mount_covariance;  // as frame_covariance
  double image_sigma_px = 0;                                                    // of tie point measurements
  MergePosition position;
  MergeCosts costs;  // of the last round
  BlockState state;
  bool converged = false;
};

// File of a tile's tracks until the result is written; lies with the checkpoints and goes with them.
std::string part_path(const Job& job, std::int64_t tile);

// Covariances at the solution; each tile's part of the result is written. `references` of the block's components.
// Collective.
void find_posterior(Job& job, const MergeInputs& inputs, const std::vector<MotionReference>& references,
                    RankRunner& runner, Adjusted& adjusted);

// All tiles' parts, on every rank; collective. Then all ranks' covariances on the first one, which knows the state.
std::vector<TilePart> gather_parts(Job& job, const Adjusted& adjusted, std::size_t tile_count);
void gather_covariances(Job& job, Adjusted& adjusted);

// What attitude priors alone tell of the orientation (common_motion.h), a line per case and part of the block.
std::vector<std::string> judge_motions(const Block& block, const Tiles& tiles, const std::vector<TilePart>& parts);

// After gather_covariances(); takes the state and the covariances over.
MergeOutcome make_outcome(Adjusted& adjusted, const Block& block, const MergeTree& tree);

}  // namespace megablock
