// Relative orientation of two images from matches that contain wrong ones.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/two_view/point_pairs.h"
#include "geometry/two_view/relative_adjustment.h"
#include "geometry/vanishing/interpretation_plane.h"
#include "io/block/features.h"

namespace megablock {

struct TwoViewOptions {
  double max_residual = 3e-3;  // largest Sampson residual, normalised units (pixels / focal length)
  // Limit of the last selection in sigmas of the residuals, where it is narrower. Sigma also makes room for transfer
  // residuals of rotations and planes, up to 1.6 times max_residual. Infinite: neither.
  double max_sigmas = 6;
  int min_inliers = 20;
  double by_chance = 0;  // share of wrong matches that fit the model by chance; 0: of matches anywhere in the image
  // Points of a sample of three or five are at least so far apart in the image a, same units, where twenty draws find
  // such a point (Kalantari 2009, M42).
  double sample_spacing = 0;
  double max_base_sigma_deg = 1;  // of the base's direction; beyond it the pair is ill-conditioned
  std::uint64_t seed = 0;
  // The vertical in the axes of each image, both up or both down: where both are known, three matches make a hypothesis
  // instead of five. What is found is free of them; where it contradicts them, they are not used.
  std::optional<AxisDirection> vertical_a = std::nullopt, vertical_b = std::nullopt;
};

// X_b = R X_a + t, |t| = 1 (t = 0 when rotation-only).
struct TwoView {
  PairModel model = PairModel::kNone;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  // The other orientation that explains a plane nearly as well (95 % of the support); the planes that other
  // pairs of its images see decide.
  std::optional<RelativeOrientation> twin;
  // Of rotation and base; the base is open when rotation-only.
  OrientationPrecision precision, twin_precision;
  bool ill_conditioned = false;  // the base's direction is worse than max_base_sigma_deg
  bool by_vertical = false;      // agrees with the verticals and has the support of what three matches and they gave
  int draws = 0;                 // of all samples
  double median_angle_deg = 0;   // of intersection of the inlier rays
  std::vector<std::uint8_t> inlier;  // [pairs]
  int inlier_count = 0;
};

// Deterministic. The model is rotation-only when the matches show no parallax, homography when nearly all lie on one
// plane (rotation and translation are then its decomposition), essential otherwise. Focal lengths may be wrong by some
// ten per cent: when no essential matrix holds, the inliers are those of the fundamental matrix and the orientation is
// its nearest calibrated one.
TwoView estimate_two_view(const PointPairs& points, const TwoViewOptions& options);

// Model, orientation, its covariance and twin as the store keeps them; the matches are the caller's.
void set_orientation(VerifiedPair& pair, const TwoView& found);

}  // namespace megablock
