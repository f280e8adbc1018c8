// Converts a block to the network of the determinant method (coplanarity_adjustment.h): single cameras of one focal
// length.
//
// Positions are the observed ones, else those that the frames start with; they are held. Angles start at the observed
// attitudes, else at those that the frames start with. Image observations become x f / z, y f / z of their viewing
// rays, which removes the distortion. f is the focal length of the first camera, so that pixels of other cameras become
// pixels of the first.
#pragma once

#include "adjust/coplanarity/coplanarity_adjustment.h"
#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

struct CoplanarityBlock {
  CoplanarityNetwork network;
  std::vector<FrameIndex> frames;    // [cameras of the network], ascending
  std::vector<Pose> mounts;          // [cameras of the network]
  double angle_sigma_rad = 0;        // rms over axes and frames of the observed attitudes; 0: there are none
  std::int64_t frames_left_out = 0;  // without position or attitude, or without a point that another frame sees
  std::int64_t points_left_out = 0;  // seen by fewer than two of the other frames

  // The pose of the frame whose camera has these angles; the camera's centre is held.
  Pose frame_pose(std::size_t camera, const XyzAngles& angles) const;
};

// Throws InputError for frames of several images, and where fewer than two frames are left.
CoplanarityBlock coplanarity_block(const Block& block, const BlockState& start, const std::vector<TrackSet>& tracks);

}  // namespace megablock
