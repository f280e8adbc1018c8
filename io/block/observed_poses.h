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
//
// The positions of a flight, a day or a receiver may have a datum of their own, as ellipsoidal heights have beside
// orthometric ones. A rig without cameras stands for such a group. The centre of its only mount is its shift o:
//
//     antenna = C + R' (l + c) + o,    o only along the axes for which PositionPrior::shifted is 1.
#pragma once

#include <cmath>

#include "geometry/transform/rotation.h"
#include "io/block/block.h"

namespace megablock {

// By how much the sigmas of a group's positions were multiplied, from their residuals.
struct PositionScale {
  RigIndex group{};
  double horizontal = 1, height = 1;
};

inline PositionPrior corrected(PositionPrior prior, const Pose& receiver) {
  prior.lever_arm += receiver.centre;
  return prior;
}
inline AttitudePrior corrected(AttitudePrior prior, const Pose& receiver) {
  prior.rotation_cw = (receiver.rotation.conjugate() * prior.rotation_cw).normalized();
  return prior;
}
// A group whose positions lie `shift` off the block's ground frame (metres), known to `sigma_m` along each axis.
inline Rig position_group(std::string name, const Eigen::Vector3d& shift, double sigma_m) {
  Mount receiver;
  receiver.pose.centre = shift;
  receiver.position_sigma_m = sigma_m;
  return {std::move(name), {receiver}};
}
// The position without the shift of its group.
inline PositionPrior without_shift(PositionPrior prior, const Pose& group) {
  prior.position -= prior.shifted.cast<double>().cwiseProduct(group.centre);
  return prior;
}
// `mounts`: the poses of all mounts of the block.
template <typename Prior>
Prior corrected(Prior prior, const Block& block, RigIndex rig,
                const IndexedVector<RigIndex, std::vector<Pose>>& mounts) {
  if constexpr (requires { prior.group; })
    if (prior.group.valid()) prior = without_shift(prior, mounts[prior.group].front());
  return block.rigs[rig].has_receiver() ? corrected(prior, mounts[rig].back()) : prior;
}

// The prior with the uncertainty of its receiver and its group, for a start that does not know them yet.
inline PositionPrior loosened(PositionPrior prior, const Block& block, RigIndex of_frame) {
  const Rig& rig = block.rigs[of_frame];
  if (rig.has_receiver())
    for (double& sigma : prior.sigma) sigma = std::hypot(sigma, rig.mounts.back().position_sigma_m);
  if (prior.group.valid())
    for (int k = 0; k < 3; ++k)
      prior.sigma[k] =
          std::hypot(prior.sigma[k], prior.shifted[k] * block.rigs[prior.group].mounts.back().position_sigma_m);
  return prior;
}
inline AttitudePrior loosened(AttitudePrior prior, const Block& block, RigIndex of_frame) {
  const Rig& rig = block.rigs[of_frame];
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
