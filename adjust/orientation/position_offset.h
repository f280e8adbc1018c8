// Finds the offset of the positions of a block from its control points, as between ellipsoidal and orthometric heights.
//
// Positions and control in two systems contradict each other by the same vector everywhere. The adjustment would ignore
// the smaller party as outliers: positions of an RTK receiver leave control no chance, and the block is 47 m off. The
// block has the datum of its positions once it is oriented. There the marks of control point i meet in X_i, and
// coordinate k of the offset is
//
//     o_k = med d_ik,   d_i = X_i - G_i,   s_k = 1.4826 med |d_ik - o_k|,
//     sigma_k^2 = 1.2533^2 max(s_k, q_k)^2 / n + (v_k sigma_f / f)^2,
//     p_k = 2 u_k + 4 sqrt(D_kk),
//
// with G_i the given coordinates and q_k the median of their sigmas. The medians tolerate outliers at nearly half of
// the n points. v is the median vector from the cameras to the points and sigma_f / f the prior sigma of the focal
// length: the cameras have their places from the positions, so a focal length that is 1 % too long puts the ground 1 %
// of the flying height too low, at every point alike.
//
// p_k is the limit of what the positions leave open at the control: D is the covariance of its middle by the similarity
// of all positions, because a tilt moves the ground of a narrow block by more than its cameras. Errors of GNSS are
// common to a flight in part, so that the sigma u_k of one position counts twice, however many they are. Positions on a
// line say nothing of the tilt, and p_k is 5 u_k.
//
// A coordinate counts when it is more than three times its own sigma, than three times the scatter s_k and than p_k:
// what differs by less is left to the weights, and what differs from point to point is a bend of the block, and no
// offset.
//
// The control decides on the datum: the block is moved by -o, and the offset is the start of an unknown of the
// adjustment, the shift that all positions have in common (io/block/observed_poses.h). They tell of one another as
// before.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct PositionOffset {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // positions minus control, metres; 0 where it does not count
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();   // of the offset
  std::int64_t points = 0;                           // control points that were compared
};

// The offset of the positions of `frames`, which hang together in `state` and have its datum from them. Empty where no
// coordinate counts, fewer than three points can be compared, or positions are held. `frames` ascend. Deterministic.
std::optional<PositionOffset> find_position_offset(const Block& block, const BlockState& state,
                                                   const std::vector<FrameIndex>& frames);

// Moves the frames by the offset, and gives it to their positions as the start of a shift. A group that has a shift
// already keeps its own, larger by the offset; its positions outside `frames` keep theirs.
void shift_positions(const PositionOffset& offset, const std::vector<FrameIndex>& frames, Block& block,
                     BlockState& state);

// Adds a group of positions to the block: those of `frames`, which lie `offset` off the state along `axes` that are 1.
void add_position_group(const std::vector<FrameIndex>& frames, const Eigen::Vector3d& offset, const ShiftAxes& axes,
                        Block& block, BlockState& state);

// "the positions lie 46.90 m above the control points (sigma 0.02 m, 6 points): ...".
std::string offset_text(const PositionOffset& offset);

}  // namespace megablock
