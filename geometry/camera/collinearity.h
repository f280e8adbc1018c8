// Evaluates the collinearity equations of one image ("image formula") with nine physical or eleven linear parameters,
// converts one set into the other, and estimates them from control points.
//
// Physical parameters: the rotation R with rows L1, L2, L3 (ground -> image, y up, looking along -z), the projection
// centre S, the principal point (x_p, y_p) and the principal distance p:
//
//     x = x_p - p L1.(M - S) / L3.(M - S),      y = y_p - p L2.(M - S) / L3.(M - S)                              (1)
//
// Linear parameters, for a ground point M relative to a local origin O:
//
//     x = (A.M + a_4) / (C.M + 1),    y = (B.M + b_4) / (C.M + 1)                                                (2)
//     A = (p L1 - x_p L3) / g,  B = (p L2 - y_p L3) / g,  C = -L3 / g,  a_4 = -A.S,  b_4 = -B.S,  g = L3.S       (3)
//
// In the other direction, A - x_p C is perpendicular to C:
//
//     x_p = A.C / C.C,  y_p = B.C / C.C,  L3 = -C / |C|,  L1 = (A - x_p C) / p|C|,  L2 likewise, p = |A - x_p C| / |C|,
//     S = [A; B; C]^-1 (-a_4, -b_4, -1)                                                                          (4)
//
// If g < 0 (the origin above the image, or far away from a tilted image), (4) gives -R, which its determinant reveals.
// If g = 0, the origin lies in the plane through S parallel to the image, and there are no eleven parameters. An origin
// below the image, or in the middle of the scene, has g > 0; the origin of a national grid need not have. Eleven
// parameters are two more than nine: they need not make L1 and L2 perpendicular, nor give both the same p. These two
// misfits measure the quality of (2).
//
// Sources: J.-F. Haas, "Mathematiques de la photogrammetrie numerique"; ENSG course of A. Pinte. From control points:
// Y. I. Abdel-Aziz and H. M. Karara, "Direct linear transformation from comparator coordinates into object space
// coordinates in close-range photogrammetry", Symposium on Close-Range Photogrammetry, 1971. Each conversion has one
// solution.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "geometry/transform/pose.h"

namespace megablock {

// The nine parameters of (1).
struct NineParameters {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // rows L1, L2, L3
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();        // S
  Eigen::Vector2d principal_point = Eigen::Vector2d::Zero();
  double principal_distance = 1;
};

// The eleven parameters of (2), with their origin.
struct ElevenParameters {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // O, ground frame, metres
  Eigen::Vector3d a, b, c;
  double a4 = 0, b4 = 0;
};

// Equations (1) and (2). A point in the plane of the projection centre gives infinite coordinates. The caller must
// check that the point lies in front of the image.
Eigen::Vector2d project(const NineParameters& image, const Eigen::Vector3d& point);
Eigen::Vector2d project(const ElevenParameters& image, const Eigen::Vector3d& point);
inline bool in_front(const NineParameters& image, const Eigen::Vector3d& point) {
  return image.rotation.row(2).dot(point - image.centre) < 0;
}

// In front of the image C.M + 1 has the sign of g; g > 0 where det [A; B; C] = -p^2 / g^3 < 0.
inline bool in_front(const ElevenParameters& image, const Eigen::Vector3d& point) {
  const double denominator = image.c.dot(point - image.origin) + 1;
  return image.a.cross(image.b).dot(image.c) < 0 ? denominator > 0 : denominator < 0;
}

// Conversions to and from the camera of this program (pose.h: y down, looking along +z). It is turned by a half turn
// about x: R_cw = diag(1, -1, -1) R. The image's y axis is reversed: x_p and p are those in pixels, and y = -(row - row
// of the principal point).
Pose pose_from(const NineParameters& image);
NineParameters nine_from(const Pose& pose, double principal_distance, const Eigen::Vector2d& principal_point);

// Equation (3). Empty where |g| is less than a millionth of the distance between O and S.
std::optional<ElevenParameters> eleven_from(const NineParameters& image, const Eigen::Vector3d& origin);
// An origin with g > 0: the point `distance` (metres) in front of the image on its axis.
Eigen::Vector3d origin_before(const NineParameters& image, double distance);

struct PhysicalParameters {
  NineParameters image;
  double skew = 0;            // departure of L1 and L2 from a right angle, radians
  double distance_ratio = 1;  // principal distance along y over that along x
};
// Equation (4). R is the rotation nearest to the rows, p the mean of both values. Empty for parallel projections and
// other matrices without a centre, and for input that is not finite.
std::optional<PhysicalParameters> nine_from(const ElevenParameters& image);

// Direct linear transformation: (2) by least squares from control points, with O in their middle. Empty for fewer than
// six points (points closer together than 1e-5 of the extent count as one), for points in one plane (root mean square
// distance from it below 1e-5 of the extent), and for input that is not finite.
std::optional<ElevenParameters> fit_eleven(std::span<const Eigen::Vector3d> ground,
                                           std::span<const Eigen::Vector2d> image);

// (1) by least squares of the image coordinates, from an approximation. Empty for fewer than five points (counted in
// the same way), for a point that comes to lie behind the image, for unknowns that the points do not determine, and
// where the iteration does not converge.
struct FittedNine {
  NineParameters image;
  double squares = 0;  // sum of squared residuals
  Eigen::Matrix<double, 9, 9>
      cofactors;  // of: rotation (right increment, 3), S, x_p, y_p, p; times sigma^2: covariance
};
std::optional<FittedNine> fit_nine(const NineParameters& start, std::span<const Eigen::Vector3d> ground,
                                   std::span<const Eigen::Vector2d> image);

// The ground point seen in two or more images (restitution): (2) times its denominator is linear in the point. It is
// solved three times, the denominators of the previous solution as weights, so that the residuals become those of the
// image coordinates. Empty for fewer than two images, for rays parallel within about 1e-7, for a point behind an image,
// and for input that is not finite.
std::optional<Eigen::Vector3d> restitute(std::span<const ElevenParameters> images,
                                         std::span<const Eigen::Vector2d> coordinates);

}  // namespace megablock
