// Moves a block without positions onto its control points before it is adjusted.
//
// Without this step the adjustment would have to carry the block over its whole distance from the ground, in linear
// steps, with wrong marks and coordinates among its observations. The similarity found here is robust: nearly half of
// the control points may be wrong. It only starts the adjustment; no observation is rejected here.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "adjust/orientation/steps/control_marks.h"
#include "geometry/similarity/similarity.h"
#include "io/block/block.h"

namespace megablock {

struct ControlAlignment {
  Similarity similarity;          // frame of the block -> ground
  std::int64_t points = 0;        // control points that could be compared
  std::int64_t agreeing = 0;      // of these, the ones that the similarity fits
  double median_residual_px = 0;  // over the points that agree
  bool on_a_line = false;         // the points lie on one line, and the images say what is down
  double best_rms_px = 0;         // over the points that decided on the similarity, the best ones
  struct Misfit {
    std::int64_t row = 0;                           // of Block::control_points
    double residual_px = 0;                         // median of its marks
    Eigen::Vector3d off = Eigen::Vector3d::Zero();  // coordinates minus the block, m; 0 where they are not known
  };
  std::vector<Misfit> misfits = {};  // points whose marks agree with each other, and that the similarity does not fit
};

// The similarity from the frame of `frames`, which hang together in `state`, to the ground. Control points count with
// the marks in images of these frames that have a pose. The alignment needs three points with all coordinates that two
// or more images see; or two, when the images tell what is down; or points of which some lack the height, in the
// minimal mixes of minimal_control.h. Empty when there are fewer, and when no similarity fits more than half of them.
// A point always fits where it is at most `mark_px` off in the images; a block that is adjusted asks for less than one
// with its first orientation.
//
// `frames` ascend. Deterministic. Where rigs have known arms, the block has its scale already, and only moves.
std::optional<ControlAlignment> align_with_control(const Block& block, const BlockState& state,
                                                   const std::vector<FrameIndex>& frames,
                                                   double mark_px = kControlMark_px);

// Moves the frames by a similarity.
void move_frames(const Similarity& similarity, const std::vector<FrameIndex>& frames, BlockState& state);

}  // namespace megablock
