// Gives the interpretation plane of a line in an image: the plane through a perspective centre and the line, given by
// its unit normal with covariance (Kalantari 2009, chapter 6).
//
// The planes of parallel lines all contain their common direction V, so V'N = 0. This holds for every centre on a
// perpendicular to the image plane: lines that meet in a vanishing point P have planes that contain the line from the
// centre to P, wherever the centre is. So neither the focal length nor the principal point is needed to find P. For a
// centre at the distance D above the image point `centre` (x right, y down, image plane at z = D) and a line rho = -x
// sin(theta) + y cos(theta) about `centre`:
//
//     N = (-D sin(theta), D cos(theta), -rho) / s,   s = sqrt(D^2 + rho^2)
//     dN / d(theta, rho) = | -D cos(theta) / s    D rho sin(theta) / s^3 |
//                          | -D sin(theta) / s   -D rho cos(theta) / s^3 |
//                          |  0                  -D^2 / s^3              |
//
// If D is the focal length and `centre` the principal point, the axes are those of the camera. For other camera models
// the plane comes from the rays a, b to two points of the line: N = a x b / |a x b|. The covariance of a normal has
// rank two, since a unit vector has no error along itself.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/camera/intrinsics.h"
#include "geometry/vanishing/image_line.h"

namespace megablock {

// A perspective centre: its foot in the image and its distance from the image plane, both in pixels.
struct PerspectiveCentre {
  Eigen::Vector2d centre;
  double distance = 1;
};
// The centre for an image of an unknown camera: as high above the middle as the longer side. Closer centres let normals
// meet the image at grazing angles; more distant ones make all planes nearly parallel to the image.
PerspectiveCentre perspective_centre(int width, int height);

// Unit normal and its covariance (rank two).
struct InterpretationPlane {
  Eigen::Vector3d normal;
  Eigen::Matrix3d covariance;
};

// The plane of a line for a given centre.
InterpretationPlane interpretation_plane(const ImageLine& line, const PerspectiveCentre& from);

// The plane of the rays to two points, with the covariances of the rays (see RayJacobian in geometry/camera/camera.h).
// Empty where both rays are the same.
std::optional<InterpretationPlane> interpretation_plane(const Eigen::Vector3d& a, const Eigen::Matrix3d& a_covariance,
                                                        const Eigen::Vector3d& b, const Eigen::Matrix3d& b_covariance);

// The plane of a line in an image of this camera, from its two independent points. Empty where the camera model has no
// ray for one of them.
std::optional<InterpretationPlane> interpretation_plane(const ImageLine& line, const Intrinsics& camera);

// The common direction of parallel lines: a unit vector of undefined sign.
struct AxisDirection {
  Eigen::Vector3d direction;
  Eigen::Matrix3d covariance;  // of rank two
};

// The direction as seen from another centre, for example from that of the camera once it is known.
AxisDirection seen_from(const AxisDirection& axis, const PerspectiveCentre& from, const PerspectiveCentre& to);

// The vanishing point of the direction in the image, in pixels. Empty at infinity.
struct ImagePoint {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance;
};
std::optional<ImagePoint> image_of(const AxisDirection& axis, const PerspectiveCentre& from);

}  // namespace megablock
