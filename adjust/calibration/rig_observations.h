// Prepares the calibration of a rig (Cannelle 2013): chooses the observations and unknowns of a block that take part,
// and computes how well a rig with given mounts and cameras fits.
//
// A calibration is the adjustment of one block whose mounts are free: with surveyed targets (off-line), from tie points
// alone (on-line, a free network), or with everything that the project gives.
#pragma once

#include <string>
#include <vector>

#include "adjust/tile/tile_adjustment.h"
#include "io/block/calibration.h"

namespace megablock {

enum class CalibrationMode { kOffLine, kOnLine, kAll };
enum class MountFreedom { kStated, kFree };

// The warnings concern the configuration. Few and badly distributed observations made a calibration of Cannelle 2013
// worse than none: 3.17 px on its verification site, where all observations gave 0.72 px.
struct RigCalibrationOptions {
  CalibrationMode mode = CalibrationMode::kAll;
  // kStated: the sigmas of the project are priors of the mounts, or hold them. kFree: all mounts but the rig's
  // reference are free. They are tied to their start by the sigmas below alone, which only affect directions that
  // nothing else determines (the scale of the rig, from tie points alone). This is the constant damping of the thesis
  // (eq. 9 to 11).
  MountFreedom mounts = MountFreedom::kStated;
  double free_position_sigma_m = 0.1, free_rotation_sigma_deg = 5;
  bool estimate_intrinsics = true;       // those that the project frees; otherwise all are held
  double held_out_share = 0.1;           // share of the tracks that is held out for the comparison with the start
  double max_position_sigma_m = 0.005;   // posterior sigma of a mount (worst axis) above which a warning is given
  double max_rotation_sigma_deg = 0.05;  // the same of its rotation
  int min_quadrant_measurements = 4;     // fewer in a quadrant of a sensor: warning
  double largest_ratio = 1.01;           // residuals of the result over those of the start; a larger ratio is refused
  int max_iterations = 50;               // of the last adjustment
  AdjustOptions adjustment;
  void check() const;  // throws InputError
};

std::string mode_name(CalibrationMode mode);

// The block with the observations and the free unknowns of the calibration. Off-line it has only control points;
// on-line only tie points, and nothing that fixes the datum. Throws InputError when there is nothing to calibrate.
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

// The whole adjustment of a block, by adjust_tile.
WholeBlock adjust_whole(const Block& block, const BlockState& start, const TrackSet& tracks,
                        const AdjustOptions& options);

// Frames and points adjusted by least squares, with the rig held at the values of `start`. The observations are those
// that `like` keeps, and the frames begin at those of `like`. Where a point then lies behind a camera, the adjustment
// begins at the frames of `start`, with a screening of its own.
WholeBlock adjust_with_rig_held(const Block& block, const BlockState& start, const WholeBlock& like,
                                const TrackSet& tracks, const AdjustOptions& options);

// The residuals of the kept image observations, by row of problem.mounts.
std::vector<ImageFit> fit_by_mount(const WholeBlock& block);
ImageFit total(const std::vector<ImageFit>& fits);

// The robust sigma per axis of observations that took no part, px. It comes from the median of their residual lengths,
// with their points intersected at the frames and rig of the state. NaN without observations.
double intersection_sigma_px(const Block& block, const BlockState& state, const TrackSet& tracks,
                             const AdjustOptions& options);

// Points of known position, intersected at the frames and rig of the state, compared with their given positions. With
// `align` a similarity fits them to these first, for a free datum. Empty with fewer than four points, or without any
// when they are not aligned.
std::optional<PointFit> intersect_known_points(const Block& block, const BlockState& state,
                                               const std::vector<ControlPoint>& points, bool align,
                                               const AdjustOptions& options);

}  // namespace megablock
