// Adds values of the block to the fingerprints of units.
#pragma once

#include "io/base/hash.h"
#include "io/block/block.h"
#include "io/block/camera_hash.h"

namespace megablock {

inline void add_to_hash(Hasher& hasher, const Eigen::Vector3d& v) { hasher.add(v.x()).add(v.y()).add(v.z()); }

inline void add_to_hash(Hasher& hasher, const Eigen::Quaterniond& q) {
  hasher.add(q.w()).add(q.x()).add(q.y()).add(q.z());
}

inline void add_to_hash(Hasher& hasher, const Pose& pose) {
  add_to_hash(hasher, pose.rotation);
  add_to_hash(hasher, pose.centre);
}

inline void add_to_hash(Hasher& hasher, const PositionPrior& prior) {
  add_to_hash(hasher, prior.position);
  add_to_hash(hasher, prior.sigma);
  add_to_hash(hasher, prior.lever_arm);
  if (prior.group.valid()) add_to_hash(hasher.add(prior.group.value), Eigen::Vector3d(prior.shifted.cast<double>()));
}

inline void add_to_hash(Hasher& hasher, const AttitudePrior& prior) {
  add_to_hash(hasher, prior.rotation_cw);
  add_to_hash(hasher, prior.sigma_rad);
}

inline void add_to_hash(Hasher& hasher, const Intrinsics& k) {
  hasher.add(k.model().kind).add(k.model().order);
  add_values_to_hash(hasher, k);
}

// The values of a frame, besides its pose, that an adjustment uses.
inline void add_priors_to_hash(Hasher& hasher, const Frame& frame) {
  if (frame.position_prior) add_to_hash(hasher.add('p'), *frame.position_prior);
  if (frame.attitude_prior) add_to_hash(hasher.add('a'), *frame.attitude_prior);
}

}  // namespace megablock
