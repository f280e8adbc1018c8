// Relative orientation of two images from matches that contain wrong ones.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "io/features.h"

namespace megablock {

// Normalised image points (X/Z, Y/Z), row i of a matched to row i of b.
struct PointPairs {
  std::vector<Eigen::Vector2d> a, b;
  std::size_t size() const { return a.size(); }
};

struct TwoViewOptions {
  double max_residual = 3e-3;  // Sampson or transfer residual, normalised units (pixels / focal length)
  int min_inliers = 20;
  double by_chance = 0;  // share of wrong matches that fit the model by chance; 0: of matches anywhere in the image
  std::uint64_t seed = 0;
};

// X_b = R X_a + t, |t| = 1 (t = 0 when rotation-only).
struct TwoView {
  PairModel model = PairModel::kNone;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double median_angle_deg = 0;       // of intersection of the inlier rays
  std::vector<std::uint8_t> inlier;  // [pairs]
  int inlier_count = 0;
};

// Deterministic. The model is rotation-only when the matches show no parallax, homography when nearly all lie on one
// plane (rotation and translation are then its decomposition), essential otherwise. Focal lengths may be wrong by some
// ten per cent: when no essential matrix holds, the inliers are those of the fundamental matrix and the orientation is
// its nearest calibrated one.
TwoView estimate_two_view(const PointPairs& points, const TwoViewOptions& options);

}  // namespace megablock
