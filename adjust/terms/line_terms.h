// Takes lines known to be vertical or horizontal as observations of the attitudes of the frames that see them.
//
// An image sees a line in its interpretation plane. A measured segment has the unit rays a, b to its ends and m to its
// middle, in the axes of the rig, and v is a direction of space in the same axes. The plane through m and v passes the
// two ends on opposite sides, at the distance
//
//     r = w (a - b)'n / 2,   n = m x v / |m x v|,   equivalently   r = w v'c / |m x v|,   c = (a - b) x m / 2,
//
// where w goes from radians to sigmas. It is the distance of the ends from the image line through the middle and the
// vanishing point of v. The direction is
//   vertical:    v = R z, z up at the frame;
//   horizontal:  v = R d with d the horizontal direction in the plane in which the other frame sees the line,
//                d = N x z / |N x z|, N = R_o' n_o (ground); one observation for successive measurements of the line.
// In a georeferenced block, "up" is the normal of the ellipsoid at the place of the frame when the problem is made (10
// km from the origin it is 0.09 degrees off the axis of the ground frame; at a line 100 m from the frame it differs by
// 0.001 degrees). In other blocks it is the axis of the ground frame. The rays are those of the given cameras and
// mounts, or of their start values where these are estimated. Their errors turn a line by less than the error of its
// measurement, as long as the focal length is good to a few per cent.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Gives the observations of the lines whose frames have poses and that `tile` owns (owner_tile of their frames). Frames
// are indices of the block here.
struct BlockLineTerm {
  FrameIndex frame, other;  // other: invalid for vertical lines
  TileProblem::LineTerm term;
};
std::vector<BlockLineTerm> line_terms(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile);

struct LineResidual {
  double residual = 0;
  Eigen::Matrix<double, 1, 6> by_frame, by_other;  // by_other: zero for vertical lines
};
// `other` is not used for vertical lines. All is zero where nothing is observed: where the line points at the camera,
// or where it is at the height of the other frame's camera.
LineResidual linearise_line(const Pose& frame, const Pose& other, const TileProblem::LineTerm& term);

}  // namespace megablock
