// The result of a job from its merged tiles.
#pragma once

#include <vector>

#include "cluster/stages/merge_start.h"
#include "io/result.h"

namespace megablock {

// Figures of the merge that do not belong to a tile.
struct MergeOutcome {
  BlockState state;
  IndexedVector<FrameIndex, BlockResult::Matrix6> frame_covariance;
  IndexedVector<CameraIndex, Eigen::MatrixXd> camera_covariance;
  double chi2 = 0;
  std::int64_t degrees_of_freedom = 0;
  double image_sigma_px = 0;  // of tie point measurements, as adjusted with
  int global_iterations = 0;
  double newton_decrement = 0;
  std::string gauge;
  std::vector<FreePart> free_parts;
  std::vector<SeamCheck> seams;
  ObservationTable observations;
};

// What one tile contributes to the result.
struct TileResult {
  TrackSet tracks;                            // ids: stable keys
  std::vector<TilePoint> points;              // rows as in the problem: tracks, then control points
  std::vector<Eigen::Vector3d> positions;     // [points]
  std::vector<Eigen::Matrix3d> covariances;   // [points] or empty
  std::vector<std::uint8_t> kept;             // [observations]
  std::vector<float> residual_x, residual_y;  // [observations] adjusted minus measured, px; NaN without pose
  std::vector<std::int64_t> begin;            // [points + 1]
  std::vector<FrameIndex> frames;             // touched
};
std::string to_bytes(const TileResult& part);
TileResult tile_result_from_bytes(const std::string& bytes);

TileResult make_tile_result(const MergeTile& tile, std::vector<Eigen::Matrix3d> covariances);

// Joins the tiles in global track order and gives the tracks their dense indices.
BlockResult assemble_result(const Job& job, const Tiles& tiles, const MergeOutcome& outcome,
                            const std::vector<TileResult>& parts);

}  // namespace megablock
