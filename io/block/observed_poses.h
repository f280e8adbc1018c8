// Holds what is common to all observed positions and attitudes: their correction by the receiver of the rig, and their
// differences from an adjusted pose.
//
// The antenna and the inertial unit of a rig are bodies of their own. A lever arm l tells where the antenna is, a
// boresight how the axes of the unit are turned against those of the rig. Both may be known badly, or not at all. The
// last mount of a rig may then be its receiver, a mount without camera. Its centre c is added to the lever arms, and
// its rotation R_m turns the attitudes:
//
//     antenna = C + R' (l + c),    observed attitude = R_m R.
//
// They are unknowns like those of every other mount, with the sigmas of the project file as their prior. The
// differences from it are about the axes of the rig, not about those of the receiver.
#pragma once

#include <cmath>

#include "geometry/transform/rotation.h"
#include "io/block/block.h"

namespace megablock {

inline PositionPrior corrected(PositionPrior prior, const Pose& receiver) {
  prior.lever_arm += receiver.centre;
  return prior;
}
inline AttitudePrior corrected(AttitudePrior prior, const Pose& receiver) {
  prior.rotation_cw = (receiver.rotation.conjugate() * prior.rotation_cw).normalized();
  return prior;
}
// `mounts`: the poses of the rig's mounts.
template <typename Prior>
Prior corrected(const Prior& prior, const Rig& rig, const std::vector<Pose>& mounts) {
  return rig.has_receiver() ? corrected(prior, mounts.back()) : prior;
}

// The prior with the uncertainty of the receiver, for a start that does not know it yet.
inline PositionPrior loosened(PositionPrior prior, const Rig& rig) {
  if (rig.has_receiver())
    for (double& sigma : prior.sigma) sigma = std::hypot(sigma, rig.mounts.back().position_sigma_m);
  return prior;
}
inline AttitudePrior loosened(AttitudePrior prior, const Rig& rig) {
  if (rig.has_receiver())
    for (double& sigma : prior.sigma_rad) sigma = std::hypot(sigma, rig.mounts.back().rotation_sigma_rad);
  return prior;
}

// Adjusted minus observed position of the antenna, metres, ground frame.
inline Eigen::Vector3d difference(const Pose& pose, const PositionPrior& prior) {
  return pose.centre + pose.rotation.conjugate() * prior.lever_arm - prior.position;
}
// Rotation from the observed to the adjusted attitude about the rig's axes, radians: w of R = Exp(w) R_observed.
inline Eigen::Vector3d difference(const Pose& pose, const AttitudePrior& prior) {
  return rotation_log<double>(pose.rotation * prior.rotation_cw.conjugate());
}

}  // namespace megablock
