// Relative orientation of two images that is known before they are matched: by the rig's mounts within a frame, by the
// trajectory between frames that follow one another on one drive. Metres off in the ground frame, a trajectory is good
// to centimetres from second to second.
#pragma once

#include <optional>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct TrustOptions {
  bool use_trajectory = true;        // of rigs of several cameras with given poses
  double max_seconds = 20;           // between two frames whose relative pose is trusted
  double position_sigma_m = 0.05;    // of it, where no relative pose states one
  double rotation_sigma_deg = 0.05;  // the same
  void check() const;                // throws InputError
};

struct TrustedPair {
  Pose a, b;                      // cameras, right with respect to one another
  double rotation_sigma_rad = 0;  // of b's rays with respect to a's
  double position_sigma_m = 0;    // of b's centre with respect to a's
  // Sigma across the epipolar line of a match at some distance, px; `pixel_sigma` is that of the images alone.
  double epipolar_sigma_px(double focal_px, double distance_m, double pixel_sigma = 1) const;
};

class TrustedPairs {
 public:
  // The block must outlive it.
  TrustedPairs(const Block& block, const TrustOptions& options);
  // Empty when nothing trusted relates the two images.
  std::optional<TrustedPair> relate(ImageIndex a, ImageIndex b) const;

 private:
  struct Step {
    Pose pose;  // of the next frame in this one
    FrameIndex next;
    double rotation_sigma_rad = 0, position_sigma_m = 0;
  };
  struct Relative {
    Pose pose;  // from -> to, centre of `to` in `from`
    double rotation_sigma_rad = 0, position_sigma_m = 0;
  };
  std::optional<Relative> between(FrameIndex from, FrameIndex to) const;
  std::optional<Relative> along_chain(FrameIndex from, FrameIndex to) const;

  const Block& block_;
  TrustOptions options_;
  IndexedVector<FrameIndex, Step> steps_;  // next invalid: no relative pose begins at the frame
};

}  // namespace megablock
