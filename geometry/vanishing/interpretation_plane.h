// The plane through a perspective centre and a line of the image, by its unit normal (Kalantari 2009, M32, M34).
//
// All planes of lines that are parallel in space hold their common direction V: V'N = 0. This is so for any centre on
// the normal of the image plane, as the planes of lines that meet in a vanishing point P hold the line to P wherever
// they come from; so neither the focal length nor the principal point is needed to find P. For a centre at the distance
// D over `centre` (x right, y down, the image plane at z = D), with the line rho = -x sin(theta) + y cos(theta) about
// `centre`:
//
//     N = (-D sin(theta), D cos(theta), -rho) / s,   s = sqrt(D^2 + rho^2)
//     dN / d(theta, rho) = | -D cos(theta) / s    D rho sin(theta) / s^3 |
//                          | -D sin(theta) / s   -D rho cos(theta) / s^3 |
//                          |  0                  -D^2 / s^3              |
//
// With D = focal length and `centre` = principal point the axes are the camera's. Cameras of any model give planes by
// the rays to the two ends of a segment, N = a x b / |a x b|. A normal's covariance has rank two: a unit vector has no
// error along itself.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/camera/intrinsics.h"
#include "geometry/vanishing/image_line.h"

namespace megablock {

// Where planes start from: a distance over a place of the image, px.
struct PerspectiveCentre {
  Eigen::Vector2d centre;
  double distance = 1;
};
// Of an image about whose camera nothing is known: the larger side over the middle. Nearer, normals meet the image at
// grazing angles; farther, all planes are nearly parallel to it.
PerspectiveCentre perspective_centre(int width, int height);

struct InterpretationPlane {
  Eigen::Vector3d normal;
  Eigen::Matrix3d covariance;
};

InterpretationPlane interpretation_plane(const ImageLine& line, const PerspectiveCentre& from);

// Of the rays to two points, with their covariances (geometry/camera/camera.h: RayJacobian). Empty for one and the same
// ray.
std::optional<InterpretationPlane> interpretation_plane(const Eigen::Vector3d& a, const Eigen::Matrix3d& a_covariance,
                                                        const Eigen::Vector3d& b, const Eigen::Matrix3d& b_covariance);

// Of a line in an image of this camera, by its independent points. Empty where the model has no rays.
std::optional<InterpretationPlane> interpretation_plane(const ImageLine& line, const Intrinsics& camera);

// A unit vector, or its negative: what lines of one direction have in common.
struct AxisDirection {
  Eigen::Vector3d direction;
  Eigen::Matrix3d covariance;  // of rank two
};

// The direction as seen from another centre: that of the camera, above all, once it is known.
AxisDirection seen_from(const AxisDirection& axis, const PerspectiveCentre& from, const PerspectiveCentre& to);

// The vanishing point in the image; empty at infinity.
struct ImagePoint {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance;
};
std::optional<ImagePoint> image_of(const AxisDirection& axis, const PerspectiveCentre& from);

}  // namespace megablock
