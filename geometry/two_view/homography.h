// Finds the homography between two images of a plane, b ~ H a, and the relative orientations that explain it.
//
// A plane n.X = d in the axes of a gives X_b = R X_a + t = (R + t n'/d) X_a, so H = R + (t/d) n' once H is scaled to a
// middle singular value of one and to positive depths. Decompose H'H = V diag(p, 1, q) V' with p >= 1 >= q. H preserves
// the lengths of v2 and of the two directions u = sqrt(1-q) v1 +- sqrt(p-1) v3. Each u gives a plane (v2, u) with the
// normal n = v2 x u, the rotation [v2, u, n] -> [H v2, H u, H v2 x H u], and t/d = (H - R) n. These are two solutions,
// each with (n, t) or (-n, -t) (Y. Ma, S. Soatto, J. Kosecka and S. Sastry, "An invitation to 3-D vision", 2004,
// section 5.3.3). Points are seen from one side of the plane only, n.a > 0. This leaves one solution or two, the twins.
//
// H itself is the null vector of the equations b x (H a) = 0, of which each point gives two independent ones (R.
// Hartley and A. Zisserman, "Multiple view geometry", 2004, section 4.1). There is one solution.
//
// Degenerate cases: three of four points on one line. p = q = 1: there is no base and H is a rotation. p = 1 or q = 1:
// the base runs along the normal and both solutions coincide.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "geometry/two_view/relative_orientation.h"

namespace megablock {

// Algebraic least squares over four or more unit rays, exact for four. H is scaled as above, with b.(H a) > 0. Empty
// for fewer than four points, for points that give fewer than eight independent equations, where one of four points
// would lie behind an image, and for input that is not finite.
std::optional<Eigen::Matrix3d> fit_homography(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

// Homography of four points (homogeneous, of any length) without least squares: with a_4 = sum l_i a_i and b_4 = sum
// m_i b_i it is B diag(m / l) A^-1. Its scale is arbitrary, its sign such that b.(H a) > 0. Empty where b.(H a) has
// different signs, for three points on one line, and for input that is not finite. RANSAC uses it, as it is much
// cheaper than a null vector.
std::optional<Eigen::Matrix3d> solve_four_point_homography(const std::array<Eigen::Vector3d, 4>& a,
                                                           const std::array<Eigen::Vector3d, 4>& b);

// Algebraic least squares for pixels, normalised first (normalising_transformation). Returns a matrix of Frobenius norm
// one. Empty as fit_homography.
std::optional<Eigen::Matrix3d> fit_pixel_homography(std::span<const Eigen::Vector2d> a,
                                                    std::span<const Eigen::Vector2d> b);

// A relative orientation together with the plane.
struct PlanarOrientation {
  RelativeOrientation orientation;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // of the plane, in the axes of a, pointing away from its centre
  double base_to_distance = 0;                        // |t| / d; zero: rotation only, base and normal have no meaning
};

// Returns all four orientations, or one for a rotation. `homography` must be scaled as by fit_homography, of calibrated
// rays. A ratio |t| / d below `min_base_to_distance` counts as a rotation.
Solutions<PlanarOrientation, 4> orientations_of_homography(const Eigen::Matrix3d& homography,
                                                           double min_base_to_distance = 1e-9);

// Returns the orientations that have at least half of the points on the visible side of the plane: both twins, or one
// of them where the other has the plane behind the image. The one with more points is first.
Solutions<PlanarOrientation, 2> visible_orientations(const Eigen::Matrix3d& homography,
                                                     std::span<const Eigen::Vector3d> a,
                                                     double min_base_to_distance = 1e-9);

}  // namespace megablock
