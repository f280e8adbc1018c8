// Gives the relative orientation of two images that is known before they are matched: within a frame from the mounts of
// the rig, between nearby frames of one drive from the trajectory. A trajectory may be off by metres in the ground
// frame, but it is accurate to centimetres from second to second.
#pragma once

#include <optional>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct TrustOptions {
  bool use_trajectory = true;        // for rigs of several cameras with given poses
  double max_seconds = 20;           // largest time between two frames whose relative pose is trusted, seconds
  double position_sigma_m = 0.05;    // of that relative pose, where the block states none; metres
  double rotation_sigma_deg = 0.05;  // the same, degrees
  void check() const;                // throws InputError
};

// A trusted relative orientation.
struct TrustedPair {
  Pose a, b;                      // poses of the two cameras in a common frame
  double rotation_sigma_rad = 0;  // of the rays of b relative to those of a
  double position_sigma_m = 0;    // of the centre of b relative to that of a
  // Standard deviation across the epipolar line of a match at this object distance (metres), in pixels. `pixel_sigma`
  // is the part of the observations alone.
  double epipolar_sigma_px(double focal_px, double distance_m, double pixel_sigma = 1) const;
};

// Finds trusted relative orientations in a block.
class TrustedPairs {
 public:
  // `block` must outlive the object. Throws InputError for impossible options.
  TrustedPairs(const Block& block, const TrustOptions& options);
  // Returns the relative orientation of two images; empty if neither mounts nor trajectory give one. Images of rigs
  // with a single camera have none.
  std::optional<TrustedPair> relate(ImageIndex a, ImageIndex b) const;

 private:
  struct Step {
    Pose pose;  // pose of the next frame in the axes of this one
    FrameIndex next;
    double rotation_sigma_rad = 0, position_sigma_m = 0;
  };
  struct Relative {
    Pose pose;  // from -> to, centre of `to` in the axes of `from`
    double rotation_sigma_rad = 0, position_sigma_m = 0;
  };
  std::optional<Relative> between(FrameIndex from, FrameIndex to) const;
  std::optional<Relative> along_chain(FrameIndex from, FrameIndex to) const;

  const Block& block_;
  TrustOptions options_;
  IndexedVector<FrameIndex, Step> steps_;  // next is invalid where no relative pose begins at the frame
};

}  // namespace megablock
