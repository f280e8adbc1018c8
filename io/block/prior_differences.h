// Computes the differences of an adjusted pose from its observed position and attitude.
#pragma once

#include "geometry/transform/rotation.h"
#include "io/block/block.h"

namespace megablock {

// Adjusted minus observed position of the antenna, metres, ground frame.
inline Eigen::Vector3d difference(const Pose& pose, const PositionPrior& prior) {
  return pose.centre + pose.rotation.conjugate() * prior.lever_arm - prior.position;
}
// Rotation from the observed to the adjusted attitude about the rig's axes, radians: w of R = Exp(w) R_observed.
inline Eigen::Vector3d difference(const Pose& pose, const AttitudePrior& prior) {
  return rotation_log<double>(pose.rotation * prior.rotation_cw.conjugate());
}

}  // namespace megablock
