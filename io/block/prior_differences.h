// How far an adjusted pose is from what was observed of it.
#pragma once

#include "geometry/transform/rotation.h"
#include "io/block/block.h"

namespace megablock {

// Adjusted antenna minus observed position, m, ground frame.
inline Eigen::Vector3d difference(const Pose& pose, const PositionPrior& prior) {
  return pose.centre + pose.rotation.conjugate() * prior.lever_arm - prior.position;
}
// Rotation from the observed to the adjusted attitude about the rig's axes, rad.
inline Eigen::Vector3d difference(const Pose& pose, const AttitudePrior& prior) {
  return rotation_log<double>(pose.rotation * prior.rotation_cw.conjugate());
}

}  // namespace megablock
