// Prepares the calibration of a rig (Cannelle 2013): it chooses the observations and unknowns of a block that take
// part, and tells how well a rig with given mounts and cameras fits.
//
// A calibration is the adjustment of one block whose mounts are free: with surveyed targets (off-line), from tie points
// alone (on-line, a free network), or with all that the project gives.
#pragma once

#include <string>
#include <vector>

#include "adjust/tile/tile_adjustment.h"
#include "io/block/calibration.h"

namespace megablock {

enum class CalibrationMode { kOffLine, kOnLine, kAll };
enum class MountFreedom { kStated, kFree };

struct RigCalibrationOptions {
  CalibrationMode mode = CalibrationMode::kAll;
  // kStated: free with the sigmas of the project as priors, or held. kFree: all but the rig's reference are free; they
  // are tied to their start by the sigmas below alone, which only what nothing else determines feels (the scale of the
  // rig, from tie points alone): the constant damping of the thesis (eq. 9 to 11).
  MountFreedom mounts = MountFreedom::kStated;
  double free_position_sigma_m = 0.1, free_rotation_sigma_deg = 5;
  bool estimate_intrinsics = true;       // those that the project frees; else all are held
  double held_out_share = 0.1;           // of tracks, of the comparison with the start
  double max_position_sigma_m = 0.005;   // posterior sigma of a mount (worst axis) above which a warning is given
  double max_rotation_sigma_deg = 0.05;  // the same of its rotation
  int min_quadrant_measurements = 4;     // fewer in a quadrant of a sensor: warning
  double largest_ratio = 1.01;           // residuals of the result / of the start, above: refused
  int max_iterations = 50;               // of the last adjustment
  AdjustOptions adjustment;
  void check() const;  // throws InputError
};

std::string mode_name(CalibrationMode mode);

// The block with the observations and the free unknowns of the calibration. Off-line: control points alone; on-line:
// tie points alone, nothing that fixes the datum. Throws InputError when there is nothing to calibrate.
Block calibration_block(Block block, const RigCalibrationOptions& options);

// The block with cameras and mounts held at the values of `rig`.
Block with_rig_held(Block block, const BlockState& rig);

// Every n-th track (`held_out`) or all others.
TrackSet select_tracks(const TrackSet& tracks, std::int64_t every, bool held_out);

// The block as one problem; points are not known yet.
struct WholeBlock {
  TileProblem problem;
  TileState state;
};
WholeBlock whole_block(const Block& block, const BlockState& state, const TrackSet& tracks,
                       const ObservationOptions& options);

// The whole adjustment of a block (adjust_tile).
WholeBlock adjust_whole(const Block& block, const BlockState& start, const TrackSet& tracks,
                        const AdjustOptions& options);

// Frames and points adjusted in least squares, to the measurements that `like` keeps and from its frames, with the rig
// held at the values of `start`. Where these cannot be projected so, from the frames of `start`, with a screening of
// its own.
WholeBlock adjust_with_rig_held(const Block& block, const BlockState& start, const WholeBlock& like,
                                const TrackSet& tracks, const AdjustOptions& options);

// Of the kept image measurements, by row of problem.mounts.
std::vector<ImageFit> fit_by_mount(const WholeBlock& block);
ImageFit total(const std::vector<ImageFit>& fits);

// Residual lengths of measurements that took no part, after their points were intersected at the state's frames and
// rig: robust sigma per axis from their median, px. NaN without any.
double intersection_sigma_px(const Block& block, const BlockState& state, const TrackSet& tracks,
                             const AdjustOptions& options);

// Points of known position, intersected at the state's frames and rig, against their given positions; by a similarity
// where the datum is free. Empty with fewer than three (one with a datum).
std::optional<PointFit> intersect_known_points(const Block& block, const BlockState& state,
                                               const std::vector<ControlPoint>& points, bool align,
                                               const AdjustOptions& options);

}  // namespace megablock
