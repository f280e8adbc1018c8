// Compares values bit by bit, so that NaN equals NaN and -0 differs from 0.
#pragma once

#include <cstring>

#include "geometry/transform/pose.h"

namespace megablock {

inline bool same_bits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }
inline bool same_bits(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return same_bits(a.x(), b.x()) && same_bits(a.y(), b.y()) && same_bits(a.z(), b.z());
}
inline bool same_bits(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return same_bits(a.w(), b.w()) && same_bits(a.vec(), b.vec());
}
inline bool same_bits(const Pose& a, const Pose& b) {
  return same_bits(a.rotation, b.rotation) && same_bits(a.centre, b.centre);
}

}  // namespace megablock
