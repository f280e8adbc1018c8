// The image formula of nine physical and of eleven linear parameters, and the way from one to the other (CP-01 to
// CP-06).
//
// Physical: ground -> image by the rotation R with rows L1, L2, L3 (image y up, looking along -z), the centre S, the
// principal point (x_p, y_p) and the principal distance p:
//
//     x = x_p - p L1.(M - S) / L3.(M - S),      y = y_p - p L2.(M - S) / L3.(M - S)                              (1)
//
// Linear, of M relative to a local origin O:
//
//     x = (A.M + a_4) / (C.M + 1),    y = (B.M + b_4) / (C.M + 1)                                                (2)
//     A = (p L1 - x_p L3) / g,  B = (p L2 - y_p L3) / g,  C = -L3 / g,  a_4 = -A.S,  b_4 = -B.S,  g = L3.S       (3)
//
// and back, with A - x_p C perpendicular to C:
//
//     x_p = A.C / C.C,  y_p = B.C / C.C,  L3 = -C / |C|,  L1 = (A - x_p C) / p|C|,  L2 likewise, p = |A - x_p C| / |C|,
//     S = [A; B; C]^-1 (-a_4, -b_4, -1)                                                                          (4)
//
// g < 0 (the origin above the image, or any origin far away and a tilted image) makes (4) give -R, which its
// determinant shows. g = 0 has no eleven parameters: the origin lies in the plane through S along the image. An origin
// below or in the middle of what the image sees has g > 0; coordinates of a national grid do not. Eleven parameters are
// two more than nine: that L1 and L2 are perpendicular and that both give the same p is lost, and measures the quality
// of (2).
//
// (J.-F. Haas, "Mathematiques de la photogrammetrie numerique"; ENSG course of A. Pinte. From control points: Y. I.
// Abdel-Aziz and H. M. Karara, "Direct linear transformation from comparator coordinates into object space coordinates
// in close-range photogrammetry", Symposium on Close-Range Photogrammetry, 1971.) Each way has one solution.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "geometry/transform/pose.h"

namespace megablock {

struct NineParameters {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // rows L1, L2, L3
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();        // S
  Eigen::Vector2d principal_point = Eigen::Vector2d::Zero();
  double principal_distance = 1;
};

struct ElevenParameters {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // O, ground
  Eigen::Vector3d a, b, c;
  double a4 = 0, b4 = 0;
};

// (1), (2). What lies in the plane of the centre gives infinities; whether it lies in front is the caller's question.
Eigen::Vector2d project(const NineParameters& image, const Eigen::Vector3d& point);
Eigen::Vector2d project(const ElevenParameters& image, const Eigen::Vector3d& point);
inline bool in_front(const NineParameters& image, const Eigen::Vector3d& point) {
  return image.rotation.row(2).dot(point - image.centre) < 0;
}

// The sign of C.M + 1 is that of g in front of the image, and g > 0 where det [A; B; C] = -p^2 / g^3 < 0.
inline bool in_front(const ElevenParameters& image, const Eigen::Vector3d& point) {
  const double denominator = image.c.dot(point - image.origin) + 1;
  return image.a.cross(image.b).dot(image.c) < 0 ? denominator > 0 : denominator < 0;
}

// Our camera (pose.h: y down, looking along +z) is turned half around x:  R_cw = diag(1, -1, -1) R, and the image's y
// is reversed: x_p and p are those of pixels, y = -(row - y_p of the pixels).
Pose pose_from(const NineParameters& image);
NineParameters nine_from(const Pose& pose, double principal_distance, const Eigen::Vector2d& principal_point);

// (3); empty where |g| is less than a millionth of the distance of O from S.
std::optional<ElevenParameters> eleven_from(const NineParameters& image, const Eigen::Vector3d& origin);
// An origin with g > 0: `distance` before the image, along its axis.
Eigen::Vector3d origin_before(const NineParameters& image, double distance);

struct PhysicalParameters {
  NineParameters image;
  double skew = 0;            // rad, departure of L1 and L2 from a right angle
  double distance_ratio = 1;  // of the principal distances along y and x
};
// (4), R being the nearest rotation, p the mean of both. Empty for parallel projections and others without a centre,
// and where something is not a number.
std::optional<PhysicalParameters> nine_from(const ElevenParameters& image);

// Direct linear transformation: (2) by least squares, O in the middle of the points. Empty for fewer than six points
// (those closer together than 1e-5 of the extent count as one), for points in one plane (their distance from it, root
// mean square, below 1e-5 of their extent), and where something is not a number.
std::optional<ElevenParameters> fit_eleven(std::span<const Eigen::Vector3d> ground,
                                           std::span<const Eigen::Vector2d> image);

// (1) by least squares of the image coordinates from a start (CP-09). Empty for fewer than five points (counted
// likewise), a point that comes to lie behind the image, unknowns that the points do not determine, or where the
// iterations do not settle.
struct FittedNine {
  NineParameters image;
  double squares = 0;  // of the residuals
  Eigen::Matrix<double, 9, 9>
      cofactors;  // of: rotation (right increment, 3), S, x_p, y_p, p; times sigma^2: covariance
};
std::optional<FittedNine> fit_nine(const NineParameters& start, std::span<const Eigen::Vector3d> ground,
                                   std::span<const Eigen::Vector2d> image);

// The point seen in two and more images (restitution): (2) times its denominator, linear; repeated with the
// denominators as weights, so that its residuals are those of the image coordinates. Empty for fewer than two images,
// rays parallel within about 1e-7, a point that comes to lie behind an image, and where something is not a number.
std::optional<Eigen::Vector3d> restitute(std::span<const ElevenParameters> images,
                                         std::span<const Eigen::Vector2d> coordinates);

}  // namespace megablock
