// Positions and attitudes that are known: held by a sigma that nothing else comes near, so that whoever weighs priors
// holds them without knowing of it. A sigma of 0 in the project file means this.
//
// Images tell a camera's position to micrometres at best, its attitude to nanoradians: what is held moves by a
// millionth of that. Coordinates of 1000 km are rounded to a hundredth of the sigma.
#pragma once

#include "io/block/block.h"

namespace megablock {

inline constexpr double kHeldPositionSigma = 1e-8;   // m
inline constexpr double kHeldAttitudeSigma = 1e-11;  // rad

// Twice: a sigma that was turned or converted is rounded.
inline bool held(const PositionPrior& prior) { return prior.sigma.minCoeff() <= 2 * kHeldPositionSigma; }
inline bool held(const AttitudePrior& prior) { return prior.sigma_rad.minCoeff() <= 2 * kHeldAttitudeSigma; }

// A held prior as one that merely comes before all others: where informations are compared, that of a held one would
// hide them all.
inline PositionPrior comparable(PositionPrior prior) {
  constexpr double kFirm = 1e-3;  // m
  if (held(prior)) prior.sigma = prior.sigma.cwiseMax(kFirm);
  return prior;
}
inline AttitudePrior comparable(AttitudePrior prior) {
  constexpr double kFirm = 1e-7;  // rad
  if (held(prior)) prior.sigma_rad = prior.sigma_rad.cwiseMax(kFirm);
  return prior;
}

// Puts oriented frames where they are held.
inline void place_held_frames(const Block& block, BlockState& state) {
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    const Frame& frame = block.frames[f];
    if (!state.oriented[f]) continue;
    Pose& pose = state.frames[f];
    if (frame.attitude_prior && held(*frame.attitude_prior)) pose.rotation = frame.attitude_prior->rotation_cw;
    if (frame.position_prior && held(*frame.position_prior))
      pose.centre = frame.position_prior->position - pose.rotation.conjugate() * frame.position_prior->lever_arm;
  }
}

}  // namespace megablock
