// Finds the relative orientation of two images from matches, many of which may be wrong. RANSAC (Kalantari 2009,
// chapters 7 and 8) comes first, then the choice between rotation, plane and general scene, and the robust adjustment
// with covariance.
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
  double max_residual = 3e-3;  // largest Sampson residual of an inlier, normalised units (pixels / focal length)
  // Limit of the final selection in standard deviations of the residuals, where it is narrower than max_residual. The
  // standard deviation also widens the limit for the transfer residuals of rotations and planes, up to 1.6 times
  // max_residual. Infinite: neither.
  double max_sigmas = 6;
  int min_inliers = 20;  // the stage `matching` sets it from MatchOptions (match/pairs/pair_matching.h)
  double by_chance = 0;  // share of wrong matches that fit by chance; 0: as for matches anywhere in the image
  // Points of a sample of three or five are at least this far apart in the image a (normalised units), if twenty draws
  // find such points (Kalantari 2009, chapter 7: 100 pixels).
  double sample_spacing = 0;
  double max_base_sigma_deg = 1;  // standard deviation of the base's direction above which the pair is ill-conditioned
  std::uint64_t seed = 0;
  // The vertical in the axes of each camera, both up or both down. Where both are known, samples have three matches
  // instead of five. The result does not contain the verticals; where it contradicts them, they are ignored.
  std::optional<AxisDirection> vertical_a = std::nullopt, vertical_b = std::nullopt;
};

// The result: X_b = R X_a + t with |t| = 1, or t = 0 for a rotation.
struct TwoView {
  PairModel model = PairModel::kNone;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  // The other orientation that explains a plane nearly as well (95 % of the support). Other pairs of the same images
  // decide between the two.
  std::optional<RelativeOrientation> twin;
  // Of rotation and base; the base of a rotation is undetermined.
  OrientationPrecision precision, twin_precision;
  bool ill_conditioned = false;      // the base's direction is less certain than max_base_sigma_deg
  bool by_vertical = false;          // found from three matches and the verticals, and in agreement with them
  int draws = 0;                     // number of RANSAC samples
  double median_angle_deg = 0;       // median intersection angle of the inlier rays
  std::vector<std::uint8_t> inlier;  // [pairs] 1 for inliers
  int inlier_count = 0;
};

// Estimates the relative orientation; the result is deterministic. The model is kNone where too few matches agree,
// rotation-only where the matches show no parallax, homography where nearly all lie on one plane (rotation and
// translation are those of its decomposition), and essential otherwise. Focal lengths may be wrong by some ten per
// cent: where no essential matrix fits, the inliers are those of the fundamental matrix, and the orientation is that of
// the nearest essential matrix.
TwoView estimate_two_view(const PointPairs& points, const TwoViewOptions& options);

// Writes model, orientation, covariance and twin into the record of the store. The caller adds the matches.
void set_orientation(VerifiedPair& pair, const TwoView& found);

}  // namespace megablock
