// Gives the type of the relative orientation of two images, and functions that all its solvers need.
//
//     X_b = R X_a + t,  |t| = 1:    E = [t]x R,    b' E a = 0    for the rays a, b of one point (coplanarity)
//
// An essential matrix belongs to four orientations: with t or -t, and with R or its twin, which is turned by 180
// degrees about t. With |t| = 1
//
//     R = cof(E) - [t]x E,    twin: cof(E) + [t]x E                        (cof([t]x) = t t')
//
// (B. K. P. Horn, "Relative orientation", IJCV 4, 1990). t is the longest cross product of two columns of E. The right
// one of the four has the points in front of both images. For a pair of rays, with u = R a and n = b x u, the depths
// along the rays are -n.(b x t) / n.n in a and n.(t x u) / n.n in b.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <span>

#include "geometry/numbers/solutions.h"
#include "geometry/transform/rotation.h"

namespace megablock {

struct RelativeOrientation {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // a -> b
  Eigen::Vector3d base = Eigen::Vector3d::UnitX();               // t: centre of a in the axes of b, unit
};

// E = [t]x R.
inline Eigen::Matrix3d essential_from(const RelativeOrientation& o) {
  return skew<double>(o.base) * o.rotation.toRotationMatrix();
}

// Matrix of cofactors, det(m) m^-T; its columns are cross products of the columns of m.
inline Eigen::Matrix3d cofactors(const Eigen::Matrix3d& m) {
  Eigen::Matrix3d c;
  c.col(0) = m.col(1).cross(m.col(2));
  c.col(1) = m.col(2).cross(m.col(0));
  c.col(2) = m.col(0).cross(m.col(1));
  return c;
}

// Returns (R, t), (R, -t), (twin, t), (twin, -t). For a matrix that is not exactly essential, the result is close to
// that of the nearest essential matrix. Empty for a matrix of rank zero or one and for input that is not finite.
Solutions<RelativeOrientation, 4> orientations_of_essential(const Eigen::Matrix3d& essential);

// Essential matrix nearest to m in the Frobenius norm, scaled to the singular values s, s, 0 with s = 1/sqrt(2).
Eigen::Matrix3d nearest_essential(const Eigen::Matrix3d& m);

// Depths of a point along its rays in units of the base, multiplied by the squared sine of the angle between the rays.
// Parallel rays thus give zeros instead of infinities.
struct ScaledDepths {
  double a, b, sine_squared;
};
inline ScaledDepths scaled_depths(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& base,
                                  const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b) {
  const Eigen::Vector3d u = rotation * ray_a, n = ray_b.cross(u);
  return {-n.dot(ray_b.cross(base)), n.dot(base.cross(u)), n.squaredNorm()};
}

// Returns whether all points lie in front of both images.
template <typename Rays>
bool all_in_front(const RelativeOrientation& o, const Rays& a, const Rays& b) {
  const Eigen::Matrix3d rotation = o.rotation.toRotationMatrix();
  for (std::size_t i = 0; i < a.size(); ++i) {
    const ScaledDepths depths = scaled_depths(rotation, o.base, a[i], b[i]);
    if (!(depths.a > 0 && depths.b > 0)) return false;
  }
  return true;
}

// Mean distance of the points from the centre of image a, in units of the base. `a` need not be unit vectors.
double mean_depth(const RelativeOrientation& o, std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

// Sampson distance of a pair of rays: the angle, to first order, by which both rays together must move to become
// coplanar with the base. Radians.
inline double coplanarity_residual(const Eigen::Matrix3d& essential, const Eigen::Vector3d& ray_a,
                                   const Eigen::Vector3d& ray_b) {
  const Eigen::Vector3d in_b = essential * ray_a, in_a = essential.transpose() * ray_b;
  const double n = ray_b.dot(in_b);
  // A movement of a ray along itself changes nothing, so the components along the rays (n, for unit rays) are
  // subtracted.
  return n / std::sqrt(in_a.squaredNorm() + in_b.squaredNorm() - 2 * n * n);
}

// Chooses among the solutions of a minimal problem, with two images alone (Kalantari 2009, chapter 7). A point supports
// a candidate with 1 - (r / threshold)^2 if its residual r is below `threshold` (radians) and it lies in front of both
// images (or its rays are parallel to within the threshold). The candidate with most support wins. Candidates with
// equal support, to one per cent, are told apart by the mean depth of these points: wrong solutions tend to have
// strongly converging axes and points closer than `min_mean_depth` bases. The second best candidate is returned as the
// twin, which a plane leaves possible, if it has more than 95 % of the best support. Empty if no candidate has support.
struct ChosenOrientation {
  RelativeOrientation orientation;
  double support = 0;
  int inliers = 0;
  std::optional<RelativeOrientation> twin;
};
struct OrientationChoice {
  double threshold = 1e-3;    // of the coplanarity residual, radians
  double min_mean_depth = 1;  // in bases; 0 where strongly converging close-range images are as likely
};
std::optional<ChosenOrientation> choose_orientation(std::span<const RelativeOrientation> candidates,
                                                    std::span<const Eigen::Vector3d> a,
                                                    std::span<const Eigen::Vector3d> b, const OrientationChoice& by);

}  // namespace megablock
