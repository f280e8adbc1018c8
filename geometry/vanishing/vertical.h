// Finds the vanishing point of the vertical (Kalantari 2009, chapter 8) and derives from it: the levelling rotation,
// the attitude from two or three perpendicular axes, and the image as a levelled camera would see it (chapter 4).
//
// Directions are in camera axes (x right, y down, z along the view). The vertical points down, so it is +y in an
// upright image. The way the camera was held gives the expected direction d. The rotation vector that turns d into a
// candidate V has a component about the viewing axis, the roll, and one perpendicular to it, the pitch; photographers
// keep the roll small but not the pitch. Moreover, all horizontal directions are perpendicular to the vertical. The
// cost of a candidate is therefore
//
//     (roll / sigma_roll)^2 + (pitch / sigma_pitch)^2 + 2 ln((1 - q) / q) sum_j w_j [V_j not orthogonal to V]
//
// where q = 0.05 allows for roofs, stairs and false detections among the other vanishing points, and w_j is the number
// of lines of point j over the largest number. The candidate with the least cost wins. Candidates beyond three sigmas
// of roll or pitch, or with a cost above 16, are rejected. Two axes count as perpendicular within `orthogonal_within`,
// or within three sigmas where they are less certain. Vanishing points within 10 degrees of the candidate do not count
// against it, because walls lean.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/vanishing_points.h"

namespace megablock {

// How the camera was held.
struct VerticalPrior {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();               // expected direction of the vertical, camera axes
  double roll_sigma = 12 * kDegree, pitch_sigma = 25 * kDegree;  // radians
  double orthogonal_within = 1 * kDegree;
};

// The direction down in the pixels as stored, from the EXIF orientation code 1 to 8 (any other value: upright).
Eigen::Vector3d down_of_exif_orientation(int code);

struct Vertical {
  int point = -1;      // index of the vanishing point
  AxisDirection down;  // unit vector, downwards
  double roll = 0;     // deviation from the expected roll, in sigmas of the prior
};
// Returns the vertical among the vanishing points of a calibrated image. Empty if no candidate is acceptable.
std::optional<Vertical> find_vertical(std::span<const VanishingPoint> points, const VerticalPrior& prior = {});

// Roll and pitch (radians) of a vertical direction: roll is positive with the right side down, pitch is positive
// looking up.
//
//     down = (sin r cos p, cos r cos p, -sin p)
struct RollPitch {
  double roll = 0, pitch = 0;
  Eigen::Matrix2d covariance;
};
RollPitch roll_pitch_of(const AxisDirection& down);

// The rotation by the smallest angle with R down = (0, 1, 0). For down = (0, -1, 0) it is a half turn about x.
Eigen::Matrix3d levelling_rotation(const Eigen::Vector3d& down);

// A direction on the ground and the direction in which the camera sees it. The caller chooses consistent signs.
struct SeenAxis {
  Eigen::Vector3d ground;  // unit
  AxisDirection seen;
};
struct AttitudeFromAxes {
  Eigen::Quaterniond rotation_cw;  // ground -> camera
  Eigen::Matrix3d covariance;      // covariance of w in R Exp(w) (rotation.h), rad^2
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
};
// Attitude from two or more axes, weighted with their covariances. Empty for fewer than two, where all are the same,
// where an axis has a covariance of zero, and for input that is not finite.
std::optional<AttitudeFromAxes> attitude_from_axes(std::span<const SeenAxis> axes);

// The homography of pixels (homogeneous) when the camera is rotated by R: K R K^-1. With R = levelling_rotation,
// vertical lines become columns of the image.
inline Eigen::Matrix3d rotation_homography(const PerspectiveCentre& camera, const Eigen::Matrix3d& rotation) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k.topLeftCorner<2, 2>() *= camera.distance;
  k.topRightCorner<2, 1>() = camera.centre;
  return k * rotation * k.inverse();
}

}  // namespace megablock
