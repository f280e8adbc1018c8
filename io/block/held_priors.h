// Positions and attitudes that are known exactly, and heights that are not known. The former get a standard deviation
// far below that of any other observation, so the adjustment holds them without a special case. A sigma of 0 in the
// project file means this.
//
// Images determine a camera's position to micrometres at best and its attitude to nanoradians; a held value moves by a
// millionth of that. Coordinates of 1000 km are rounded to a hundredth of the sigma.
#pragma once

#include "io/block/block.h"
#include "io/block/observed_poses.h"

namespace megablock {

inline constexpr double kHeldPositionSigma = 1e-8;   // metres
inline constexpr double kHeldAttitudeSigma = 1e-11;  // radians

// The sigma of a height that is not known, metres: so large that the height is practically free.
inline constexpr double kUnknownHeightSigma = 1000;

// The factor of two allows for sigmas that were rounded in a rotation or conversion.
inline bool held(const PositionPrior& prior) { return prior.sigma.minCoeff() <= 2 * kHeldPositionSigma; }
inline bool held(const AttitudePrior& prior) { return prior.sigma_rad.minCoeff() <= 2 * kHeldAttitudeSigma; }

// A held prior with a sigma that is merely far below all others. Where the information of observations is compared,
// that of a held prior would hide all others.
inline PositionPrior comparable(PositionPrior prior) {
  constexpr double kFirm = 1e-3;  // metres
  if (held(prior)) prior.sigma = prior.sigma.cwiseMax(kFirm);
  return prior;
}
inline AttitudePrior comparable(AttitudePrior prior) {
  constexpr double kFirm = 1e-7;  // radians
  if (held(prior)) prior.sigma_rad = prior.sigma_rad.cwiseMax(kFirm);
  return prior;
}

// Sets oriented frames to their held positions and attitudes.
inline void place_held_frames(const Block& block, BlockState& state) {
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    const Frame& frame = block.frames[f];
    if (!state.oriented[f]) continue;
    Pose& pose = state.frames[f];
    if (frame.attitude_prior && held(*frame.attitude_prior))
      pose.rotation = corrected(*frame.attitude_prior, block, frame.rig, state.mounts).rotation_cw;
    if (frame.position_prior && held(*frame.position_prior)) {
      const PositionPrior prior = corrected(*frame.position_prior, block, frame.rig, state.mounts);
      pose.centre = prior.position - pose.rotation.conjugate() * prior.lever_arm;
    }
  }
}

}  // namespace megablock
