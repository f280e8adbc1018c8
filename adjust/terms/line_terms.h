// Lines known to be vertical or horizontal, as observations of the attitudes of the frames that see them.
//
// An image sees a line in its interpretation plane. Of a measured segment with rays a, b to its ends (unit, rig axes)
// and m to its middle, and a direction v of space (rig axes), the plane through m and v leaves the ends on either side
// by
//
//     r = w (a - b)'n / 2,   n = m x v / |m x v|,   equivalently   r = w v'c / |m x v|,   c = (a - b) x m / 2,
//
// w from radians to sigmas: the ends' distance from the image line through the middle and the vanishing point of v.
//   vertical:    v = R z, z up at the frame;
//   horizontal:  v = R d with d the horizontal direction in the plane in which the other frame sees the line,
//                d = N x z / |N x z|, N = R_o' n_o (ground); one observation for successive measurements of the line.
// "Up" is the ellipsoid's normal at the frame, where it stands when the terms are made, in a georeferenced block (10 km
// from the origin that is 0.09 degrees off the ground's axis; a line 100 m from the frame is 0.001 degrees off it),
// else the ground's axis. The rays are those of the given cameras and mounts (start values, where these are estimated):
// they turn a line by less than its measurement can tell, as long as the focal length is good to some per cent.
#pragma once

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Terms of the lines whose frames have poses and that `tile` owns (owner_tile of their frames). Frames are global
// indices here.
struct BlockLineTerm {
  FrameIndex frame, other;  // other: invalid for vertical lines
  TileProblem::LineTerm term;
};
std::vector<BlockLineTerm> line_terms(const Block& block, const BlockState& state, const Tiles& tiles, TileIndex tile);

struct LineResidual {
  double residual = 0;
  Eigen::Matrix<double, 1, 6> by_frame, by_other;  // by_other: zero for vertical lines
};
// `other`: anything for vertical lines. All zero where the line points at the camera, or the other frame sees it at the
// height of its own eye: nothing is observed there.
LineResidual linearise_line(const Pose& frame, const Pose& other, const TileProblem::LineTerm& term);

}  // namespace megablock
