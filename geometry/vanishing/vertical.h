// Which vanishing point is that of the vertical (Kalantari 2009, M44), and what follows from it: levelling (M20), the
// attitude from two or three orthogonal axes (M19), the image seen from a levelled camera (M22).
//
// Directions are in camera axes (x right, y down, z along the view), so that the vertical points down: +y in a picture
// that was taken upright. How the camera was held gives the direction d that is expected. The rotation vector
// that takes d to a candidate V has a part about the viewing axis, the roll, and one across it, the pitch;
// photographers keep the first small and not the second. Everything horizontal is orthogonal to the vertical. So the
// cost is
//
//     (roll / sigma_roll)^2 + (pitch / sigma_pitch)^2 + 2 ln((1 - q) / q) sum_j w_j [V_j not orthogonal to V]
//
// with q = 0.05 for roofs, stairs and accidents among the other vanishing points, w_j their lines over the most lines
// of any; the least cost wins. Candidates beyond three sigmas of roll or pitch, or with a cost above 16, are none.
// Orthogonal is within `orthogonal_within`, or three sigmas where the two axes are less certain. Vanishing points
// within 10 degrees of the candidate are no evidence against it: walls lean.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/vanishing_points.h"

namespace megablock {

struct VerticalPrior {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  double roll_sigma = 12 * kDegree, pitch_sigma = 25 * kDegree;  // radians
  double orthogonal_within = 1 * kDegree;
};

// Where down is in the pixels as they are stored, by the EXIF code 1 to 8 (anything else: upright).
Eigen::Vector3d down_of_exif_orientation(int code);

struct Vertical {
  int point = -1;      // index of the vanishing point
  AxisDirection down;  // unit, signed
  double roll = 0;     // from where it was expected, in sigmas of the prior
};
// Empty without a candidate.
std::optional<Vertical> find_vertical(std::span<const VanishingPoint> points, const VerticalPrior& prior = {});

// Roll: right side down is positive; pitch: looking up is positive (radians). Of a vertical direction (down):
//     down = (sin r cos p, cos r cos p, -sin p).
struct RollPitch {
  double roll = 0, pitch = 0;
  Eigen::Matrix2d covariance;
};
RollPitch roll_pitch_of(const AxisDirection& down);

// The rotation by the least angle with R down = (0, 1, 0), also for down = (0, -1, 0), which is half a turn about x.
Eigen::Matrix3d levelling_rotation(const Eigen::Vector3d& down);

// An axis of the ground and where the camera sees it. Signs are the caller's.
struct SeenAxis {
  Eigen::Vector3d ground;  // unit
  AxisDirection seen;
};
struct AttitudeFromAxes {
  Eigen::Quaterniond rotation_cw;  // ground -> camera
  Eigen::Matrix3d covariance;      // of w in R Exp(w) (rotation.h)
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
};
// Of two axes or more, with the covariances of all. Empty for fewer, when all are one, where an axis has no errors (a
// covariance of zero) and where something is not a number.
std::optional<AttitudeFromAxes> attitude_from_axes(std::span<const SeenAxis> axes);

// Pixels of the image turned by R: K R K^-1, homogeneous. With R = levelling_rotation verticals become columns.
inline Eigen::Matrix3d rotation_homography(const PerspectiveCentre& camera, const Eigen::Matrix3d& rotation) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k.topLeftCorner<2, 2>() *= camera.distance;
  k.topRightCorner<2, 1>() = camera.centre;
  return k * rotation * k.inverse();
}

}  // namespace megablock
