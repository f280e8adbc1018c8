// Homography between two images of a plane, b ~ H a, and the two relative orientations that explain it.
//
// The points of a plane n.X = d in the axes of a satisfy  X_b = R X_a + t = (R + t n'/d) X_a,  so that  H = R + (t/d)
// n' once it is scaled to a middle singular value of one and to positive depths. With H'H = V diag(p, 1, q) V', p >= 1
// >= q, the directions  u = sqrt(1-q) v1 +- sqrt(p-1) v3  are those that H keeps in length together with v2; each plane
// (v2, u) has the normal n = v2 x u and the rotation [v2, u, n] -> [H v2, H u, H v2 x H u], and t/d = (H - R) n. These
// are two solutions, each with n, t or -n, -t (Y. Ma, S. Soatto, J. Kosecka and S. Sastry, "An invitation to 3-D
// vision", 2004, 5.3.3). Points seen from one side only give n.a > 0 and leave one or both: the twins of a plane.
//
// H itself is the null vector of the equations b x (H a) = 0, two of every point (R. Hartley and A. Zisserman,
// "Multiple view geometry", 2004, 4.1): one solution.
//
// Degenerate: three of four points on one line. p = q = 1: no base, H is a rotation. p or q = 1: the base along the
// normal, where both solutions coincide.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// Least squares (algebraic) over four and more unit rays, exact for four; scaled as above, so that b.(H a) > 0. Empty
// for fewer than four points, for points whose number of independent equations is less than eight, where a point of
// four would lie behind an image, and where something is not a number.
std::optional<Eigen::Matrix3d> fit_homography(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

// Of four points (homogeneous, of any length) without least squares: with a_4 = sum l_i a_i and b_4 = sum m_i b_i it is
// B diag(m / l) A^-1. Not scaled, of the sign with b.(H a) > 0; empty where that has not one sign, for three points on
// one line, and where something is not a number.
std::optional<Eigen::Matrix3d> solve_four_point_homography(const std::array<Eigen::Vector3d, 4>& a,
                                                           const std::array<Eigen::Vector3d, 4>& b);

// Least squares for pixels (normalising_transformation); of Frobenius norm one.
std::optional<Eigen::Matrix3d> fit_pixel_homography(std::span<const Eigen::Vector2d> a,
                                                    std::span<const Eigen::Vector2d> b);

struct PlanarOrientation {
  RelativeOrientation orientation;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // of the plane in the axes of a, away from its centre
  double base_to_distance = 0;                        // |t| / d; zero: rotation only, base and normal mean nothing
};

// All four of them, or one for a rotation. `homography`: of calibrated rays, its scale and sign being those of
// fit_homography. Base-to-distance ratios below `min_base_to_distance` count as a rotation.
Solutions<PlanarOrientation, 4> orientations_of_homography(const Eigen::Matrix3d& homography,
                                                           double min_base_to_distance = 1e-9);

// Those with at least half of the points on the visible side of the plane: the twins (or one, where the other has the
// plane behind the image). The one with more points on it first.
Solutions<PlanarOrientation, 2> visible_orientations(const Eigen::Matrix3d& homography,
                                                     std::span<const Eigen::Vector3d> a,
                                                     double min_base_to_distance = 1e-9);

}  // namespace megablock
