// Finds groups of positions that have a datum of their own, as those of two flights, days or receivers.
//
// The oriented block tells how the positions should lie to each other. With x_f the antenna of frame f in the block and
// p_f its observed position, groups g have
//
//     p_f = s R x_f + t + o_g,    o = 0 for the largest group.
//
// The offsets have a closed solution: with each group about its own centroid, s R is the similarity of all groups
// together, and o_g the difference of the translations. It is repeated with weights 1 / |r_f|, which gross errors do
// not move.
//
// Candidates for the groups are the folders of the images, their rigs, flights (exposures without a gap of ten
// minutes), the two sides of a moment, and two heaps of residuals. A group counts where it has four positions or more,
// and where, along some axis,
//
//     |o_g| > 3 sigma_p  and  |o_g| > k s,    k = 3 for folders, rigs and flights, 6 (1 + 6 / n) for the last two,
//
// with sigma_p the median of the stated sigmas and s = 1.4826 med |r| within the groups; and where the residuals along
// this axis are half of those of one group that may be bent, or less (mean of |r|; the bend is a polynomial of the
// second order). Four positions and 80 % of the group must lie within a quarter of the offset from it: three gross
// errors and a good position are no group. Sides and heaps are chosen among many, so that k is larger for them: a
// single heap of normal errors that is cut in the middle has sides 2.6 s apart. They are tried where no folder, rig or
// flight counts, for up to 20 000 positions. Of all candidates that with the smallest residuals is taken. Where
// positions lie on lines, nothing but the present attitude of the block tells the turn about them.
//
// The offset is the start of an unknown of the adjustment (io/block/observed_poses.h). Positions that follow the block
// less well than the initial orientation is accurate, as two flights of a RTK receiver that lie decimetres apart, are
// not found here.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "geometry/similarity/similarity.h"
#include "io/block/block.h"

namespace megablock {

struct PositionShift {
  std::vector<FrameIndex> frames;                    // of the group, ascending
  std::string kind;                                  // what they have in common: "folder 'b'", "flight 2", ...
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // from the positions of the largest group, metres
  ShiftAxes shifted{0, 0, 0};                        // 1: the offset counts along this axis
  std::size_t others = 0;                            // positions of the largest group
};

struct PositionShifts {
  std::vector<PositionShift> groups;
  Similarity to_others;  // moves the block to the datum of the largest group
};

// The groups among `frames`, which hang together in `state` and have their datum from the positions. Frames whose
// position belongs to a group already take no part. None where a position or attitude is held: it gives the datum.
// Deterministic.
PositionShifts find_position_shifts(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames);

// "9 positions (images from DJI_0027.JPG on) lie 29.81 m above the 9 of the largest group: ...".
std::string shift_text(const Block& block, const PositionShift& shift);

}  // namespace megablock
