// Finds the offset of the positions of a block from its control points, as between ellipsoidal and orthometric heights.
//
// Positions and control in two systems contradict each other by the same vector everywhere. The adjustment would ignore
// the smaller party as outliers: positions of an RTK receiver leave control no chance, and the block is 47 m off. The
// block has the datum of its positions once it is oriented. There the marks of control point i meet in X_i, and
// coordinate k of the offset is
//
//     o_k = med d_ik,   d_i = X_i - G_i,   s_k = 1.4826 med |d_ik - o_k|,
//     sigma_k^2 = 1.2533^2 max(s_k, q_k)^2 / n + (v_k sigma_f / f)^2,
//
// with G_i the given coordinates and q_k the median of their sigmas. The medians tolerate outliers at nearly half of
// the n points. v is the median vector from the cameras to the points and sigma_f / f the prior sigma of the focal
// length: the cameras have their places from the positions, so a focal length that is 1 % too long puts the ground 1 %
// of the flying height too low, at every point alike. A coordinate counts when it is three times its own sigma and five
// times that of a position, and three times the scatter s_k: what differs by less is left to the weights, and what
// differs from point to point is a bend of the block, and no offset.
//
// The control decides on the datum: block and positions are moved by -o. Thereafter the positions know the datum only
// through the control, which must not count twice. N positions of sigma p give a coordinate of the datum to p /
// sqrt(N). Their sigmas are raised until this is three times sigma_k:
//
//     p_k'^2 = p_k^2 + N (3 sigma_k)^2,
//
// and their information is at most a tenth of that of the control, so that sigmas of the datum are too small by 5 % at
// most. What positions tell of one another is weakened by this; that is the price for an offset that is no unknown of
// the adjustment.
//
// The adjusted block has the datum of the control, a calibrated camera, and its own differences r_fk from the N moved
// positions. So it knows the offset better than the orientation did:
//
//     o_k' = o_k - med r_fk,   sigma_k'^2 = 1.2533^2 (1.4826 med |r_fk - med r_fk|)^2 / N + med v_fk,
//
// with v_fk the variances of the projection centres, which they have mostly in common, from the control.
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
  Eigen::Vector3d before = Eigen::Vector3d::Zero();  // median sigmas of the positions, as they were
  Eigen::Vector3d after = Eigen::Vector3d::Zero();   // and as they are raised
  std::int64_t points = 0;                           // control points that were compared
};

// The offset of the positions of `frames`, which hang together in `state` and have its datum from them. Empty where no
// coordinate counts, fewer than three points can be compared, or positions are held. `frames` ascend. Deterministic.
std::optional<PositionOffset> find_position_offset(const Block& block, const BlockState& state,
                                                   const std::vector<FrameIndex>& frames);

// Moves frames and positions by the offset, and raises the sigmas of the positions.
void remove_offset(const PositionOffset& offset, const std::vector<FrameIndex>& frames,
                   IndexedVector<FrameIndex, Frame>& positions, BlockState& state);

// "the positions lie 46.90 m above the control points (sigma 0.02 m, 6 points): ...".
std::string offset_text(const PositionOffset& offset);

// Positions that were moved onto the control together, ascending.
struct MovedPositions {
  PositionOffset offset;
  std::vector<FrameIndex> frames;
};

// The offset as the adjusted block knows it. `variances`: of the projection centres, m^2. Coordinates that were not
// moved stay zero.
PositionOffset adjusted_offset(const MovedPositions& moved, const Block& block, const BlockState& adjusted,
                               const IndexedVector<FrameIndex, Eigen::Vector3d>& variances);

// "in the adjusted block the positions lie 46.98 m above the control points (sigma 0.02 m)".
std::string adjusted_offset_text(const PositionOffset& offset);

}  // namespace megablock
