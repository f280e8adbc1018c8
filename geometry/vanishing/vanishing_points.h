// Finds vanishing points of the lines of one image, by interpretation planes on the unit sphere (Kalantari 2009,
// chapter 6).
//
// The interpretation planes of parallel lines have normals N on a great circle, whose pole is the vanishing point V
// (interpretation_plane.h). The fullest great circle is found and its lines are removed, then the next, and so on.
//
// * tolerance: t is the median over the lines of the largest sigma of their normals. It follows from the image, not
//   from a setting.
// * draws: V = N1 x N2 of random pairs, half as many as there are lines but at least `min_draws`; all pairs if these
//   are fewer. The V with most normals within t of its circle is kept.
// * stop: the normal of an arbitrary line is within t of a given circle with probability p = sin(t). Among n such
//   lines, the best of n (n - 1) / 2 circles has k lines by accident with the expected number of times (false alarms)
//
//       NFA = n (n - 1) / 2 * P(Binomial(n - 2, p) >= k - 2).
//
//   The first circle with log10 NFA above `max_log10_nfa` ends the search.
// * refinement: V minimises sum (V'N)^2 / (V' S_N V) over the normals within 2 t, three times.
// * removal: all normals within max(2 t, 3 sigma) of the circle are removed.
// * leftovers: lines with larger errors than stated, above all lines bent by distortion, survive the removal. They lie
//   on both sides of the circle alike: a circle nearby has as many of them as its mirror image. So a circle within 5
//   degrees of an earlier one is rejected unless it has more lines than its mirror image, at a level of 1 %.
//
// If two families are nearly parallel, the first takes lines of the second. All lines are therefore assigned again at
// the end, each to the nearest axis in standard deviations, if within five. Axes left with too few lines for their NFA
// are dropped.
//
// The pieces of one broken edge are no evidence for a vanishing point. Lines that may be one and the same, by their
// covariances, count once in the search and in the stopping rule; all of them enter the fit.
//
// The direction and its covariance come from a Gauss-Helmert fit (gauss_helmert.h) with the equation V'N = 0. V moves
// in its tangent plane, which keeps its unit length without a constraint, and the covariances of the normals enter with
// their rank of two.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

struct VanishingOptions {
  double max_log10_nfa = -4;                // a vanishing point by accident is expected in one image of 10^4
  int min_draws = 1000;                     // number of pairs drawn at least
  double max_normal_sigma = 0.5 * kDegree;  // radians; less certain lines are left out, as they would only raise t
  double max_axis_sigma = 2 * kDegree;      // radians; a narrow bundle of lines does not determine a vanishing point
  std::uint64_t seed = 1;                   // of the draws, one per image
};

struct VanishingPoint {
  AxisDirection axis;
  double log10_nfa = 0;
  double weighted_squares = 0;  // over redundancy: the variance factor of the covariances of the lines
  std::int64_t redundancy = 0;
  std::vector<int> lines;  // indices of the lines that it was estimated from
};

struct VanishingPoints {
  std::vector<VanishingPoint> points;  // in the order in which they were found
  std::vector<int> point_of;           // for every line, index of its vanishing point; -1: none
  double tolerance = 0;                // t, radians
};

// Returns the vanishing points of the planes of one image. Planes that are not finite or have no error are left out.
// The result depends only on the planes and the options.
VanishingPoints find_vanishing_points(std::span<const InterpretationPlane> planes,
                                      const VanishingOptions& options = {});

struct FittedAxis {
  AxisDirection axis;
  double weighted_squares = 0;
  std::int64_t redundancy = 0;
};
// The common direction of planes. Empty for fewer than two planes, and where all planes are the same.
std::optional<FittedAxis> fit_axis(std::span<const InterpretationPlane> planes);

}  // namespace megablock
