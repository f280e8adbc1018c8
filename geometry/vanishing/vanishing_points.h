// Vanishing points of the lines of one image, by planes on the unit sphere (Kalantari 2009, M33, M34).
//
// The normals N of the interpretation planes of parallel lines lie on the great circle whose pole is their vanishing
// point V (interpretation_plane.h). Great circles are taken away one by one, the fullest first:
//
//   tolerance   t, the median over the lines of their normal's largest sigma: a property of the image, no setting.
//   draws       V = N1 x N2 of half as many random pairs as there are lines, or `min_draws` where that is more, or all
//               pairs where these are fewer; the V with most normals within t of its circle.
//   stop        a normal without reason is within t of a given circle with probability p = sin(t). Of n lines k on the
//               circle of the best of n (n - 1) / 2 pairs are expected so often without reason
//
//                   NFA = n (n - 1) / 2 * P(Binomial(n - 2, p) >= k - 2).
//
//               The first circle for which log10 NFA is above `max_log10_nfa` ends the search.
//   refinement  the V that makes sum (V'N)^2 / (V' S_N V) least over normals within 2 t, three times.
//   removal     of all normals within max(2 t, 3 sigma) of the circle.
//
//   strays      lines of a family whose errors are larger than stated, bent by the lens above all, are left by the
//   removal.
//               They lie on either side of its circle alike: as many on a circle nearby as on its mirror image. An
//               axis within 5 degrees of one before is none if its lines are not more than those of its mirror image,
//               at a level of 1 %.
//
// Where two families are nearly parallel, the first takes lines of the second. So all lines are dealt out again at the
// end, each to the axis that it is nearest to in sigmas, if within five; what then has too few for its NFA is dropped.
// What the pieces of one broken edge have in common is no evidence for a vanishing point: lines that may be one and the
// same, by their covariances, count once in search and stop, all in the fit.
//
// The direction and its covariance are those of the Gauss-Helmert fit (gauss_helmert.h) with the equation V'N = 0, V
// moving in its tangent plane: unit length is kept instead of being bordered, and normals bring their covariances of
// rank two as they are.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

struct VanishingOptions {
  double max_log10_nfa = -4;
  int min_draws = 1000;
  double max_normal_sigma = 0.5 * kDegree;  // radians; shorter lines would only raise t
  double max_axis_sigma = 2 * kDegree;      // radians; one narrow bundle of lines has no vanishing point
  std::uint64_t seed = 1;                   // of the image
};

struct VanishingPoint {
  AxisDirection axis;
  double log10_nfa = 0;
  double weighted_squares = 0;  // over redundancy: the variance factor of the lines' covariances
  std::int64_t redundancy = 0;
  std::vector<int> lines;  // those that it was estimated from
};

struct VanishingPoints {
  std::vector<VanishingPoint> points;  // as they were found
  std::vector<int> point_of;           // of every line; -1: none
  double tolerance = 0;                // t, radians
};

// Planes with numbers that are not finite or without error are left out. The same result for the same planes and seed.
VanishingPoints find_vanishing_points(std::span<const InterpretationPlane> planes,
                                      const VanishingOptions& options = {});

struct FittedAxis {
  AxisDirection axis;
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
};
// The axis that planes have in common (M34). Empty for fewer than two, and planes that are all one.
std::optional<FittedAxis> fit_axis(std::span<const InterpretationPlane> planes);

}  // namespace megablock
