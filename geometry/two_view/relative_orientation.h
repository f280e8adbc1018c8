// Relative orientation of two images: what its solvers share.
//
//     X_b = R X_a + t,  |t| = 1:    E = [t]x R,    b' E a = 0    for the rays a, b of one point (coplanarity)
//
// An essential matrix has four orientations: t and -t, R and its twin, turned by 180 deg about t. With |t| = 1
//
//     R = cof(E) - [t]x E,    twin: cof(E) + [t]x E                        (cof([t]x) = t t')
//
// (B. K. P. Horn, "Relative orientation", IJCV 4, 1990), t being the longest cross product of two columns of E. Which
// one is meant the points tell: they lie in front of both images. For a ray pair, with u = R a and n = b x u, the
// depths along the rays are  -n.(b x t) / n.n  and  n.(t x u) / n.n.
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

inline Eigen::Matrix3d essential_from(const RelativeOrientation& o) {
  return skew<double>(o.base) * o.rotation.toRotationMatrix();
}

// Cofactors: the columns are cross products of the columns of m.
inline Eigen::Matrix3d cofactors(const Eigen::Matrix3d& m) {
  Eigen::Matrix3d c;
  c.col(0) = m.col(1).cross(m.col(2));
  c.col(1) = m.col(2).cross(m.col(0));
  c.col(2) = m.col(0).cross(m.col(1));
  return c;
}

// (R, t), (R, -t), (twin, t), (twin, -t). Of a matrix that is not quite essential approximately those of the nearest
// one. Empty for a matrix of rank one or zero or with what is not a number.
Solutions<RelativeOrientation, 4> orientations_of_essential(const Eigen::Matrix3d& essential);

// The essential matrix nearest to m (singular values s, s, 0 with s = 1/sqrt(2)): of the sum of squares.
Eigen::Matrix3d nearest_essential(const Eigen::Matrix3d& m);

// Distances along the rays (in units of the base) to where they are nearest one another; times sin^2 of the angle
// between them, so that parallel rays give zeros rather than infinities.
struct ScaledDepths {
  double a, b, sine_squared;
};
inline ScaledDepths scaled_depths(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& base,
                                  const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b) {
  const Eigen::Vector3d u = rotation * ray_a, n = ray_b.cross(u);
  return {-n.dot(ray_b.cross(base)), n.dot(base.cross(u)), n.squaredNorm()};
}

// Whether all points lie in front of both images.
template <typename Rays>
bool all_in_front(const RelativeOrientation& o, const Rays& a, const Rays& b) {
  const Eigen::Matrix3d rotation = o.rotation.toRotationMatrix();
  for (std::size_t i = 0; i < a.size(); ++i) {
    const ScaledDepths depths = scaled_depths(rotation, o.base, a[i], b[i]);
    if (!(depths.a > 0 && depths.b > 0)) return false;
  }
  return true;
}

// Mean depth of the points in image a, in units of the base.
double mean_depth(const RelativeOrientation& o, std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

// Distance of a ray pair from the nearest one that is coplanar with the base, to first order (Sampson), radians: both
// rays move across themselves.
inline double coplanarity_residual(const Eigen::Matrix3d& essential, const Eigen::Vector3d& ray_a,
                                   const Eigen::Vector3d& ray_b) {
  const Eigen::Vector3d in_b = essential * ray_a, in_a = essential.transpose() * ray_b;
  const double n = ray_b.dot(in_b);
  // The components along the rays (n itself, for unit rays) do not move them.
  return n / std::sqrt(in_a.squaredNorm() + in_b.squaredNorm() - 2 * n * n);
}

// Choice among the solutions of a minimal problem by two images alone (Kalantari 2009, M41): of the candidates whose
// supporting points lie in front of both images, the one with most support, a point giving 1 - (r / threshold)^2 where
// its residual r is below `threshold` [rad] and it lies in front (or its rays are parallel to within the threshold).
// Candidates whose support is the same to a hundredth are told apart by the mean depth of these points: below
// `min_mean_depth` bases the axes would converge strongly, which wrong solutions do. The second best is the twin that a
// plane leaves open when it has more than 95 % of the support.
struct ChosenOrientation {
  RelativeOrientation orientation;
  double support = 0;
  int inliers = 0;
  std::optional<RelativeOrientation> twin;
};
struct OrientationChoice {
  double threshold = 1e-3;    // rad, of the coplanarity residual
  double min_mean_depth = 1;  // in bases; 0: close-range images whose axes converge strongly are as likely
};
std::optional<ChosenOrientation> choose_orientation(std::span<const RelativeOrientation> candidates,
                                                    std::span<const Eigen::Vector3d> a,
                                                    std::span<const Eigen::Vector3d> b, const OrientationChoice& by);

}  // namespace megablock
