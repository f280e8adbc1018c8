// Finds vanishing points by circles in the image (Kalantari 2009, chapter 5). The circles exist for comparison with
// vanishing_points.h, which uses the same statistics and needs no origin. Points are pixels, so one exactly at infinity
// cannot be represented.
//
// Lines that meet in P have the feet H of their perpendiculars from an origin O on the circle of diameter OP (Thales).
// Its centre is K = P / 2, its radius |K|, hence |K - H| - |K| = 0. Two feet determine a circle through O, by
// |H|^2 = P'H. With the distance rho of a line from O and its normal n the residual is
//
//     |K - H| - |K| = (|H|^2 - 2 K'H) / (|K - H| + |K|) = rho (rho - n'P) / (|K - H| + |K|),
//
// The second form is computed, because |K| may be far larger than |H|. Lines near O fit every circle. Lines with |rho|
// below 3 sigma or below 2 % of the image diagonal are therefore left out.
//
// The steps are:
//
// * band: the median of the larger half axes of the error ellipses of the feet.
// * search: as in vanishing_points.h, with pairs of feet. An arbitrary line has any theta and rho in the image; so the
//   probability p of the stopping rule is the share of (theta, rho) inside the band of the circle.
// * fit: w |H|^2 = (w P)'H as a null vector, in units of the mean |H|; a P at infinity does not disturb it. Then a
//   Gauss-Helmert adjustment with the covariances of the lines. Its unknowns are the direction of P and the inverse of
//   its distance: they are normally distributed also where P is close to infinity.
// * origin: first the upper left corner, then the centroid of the circle centres found from there, from which the
//   circles cross at large angles.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

struct CircleOptions {
  double max_log10_nfa = -4;  // largest log10 of the number of false alarms, as in vanishing_points.h
  int min_draws = 1000;
  double max_theta_sigma = 0.5 * kDegree;  // lines of a less certain direction are left out; radians
  std::uint64_t seed = 1;                  // seed of the draws, one per image
};

// A vanishing point with the lines on its circle.
struct CirclePoint {
  ImagePoint point;
  double log10_nfa = 0;
  std::vector<int> lines;
};

// Returns the vanishing points of an image of this size (pixels). Points whose adjustment does not converge are left
// out.
std::vector<CirclePoint> find_vanishing_points_by_circles(std::span<const ImageLine> lines, int width, int height,
                                                          const CircleOptions& options = {});

// The point in which the lines meet, by the adjustment and by the algebraic fit alone, in the coordinates of the lines.
// Lines within three standard deviations of the origin are left out. Empty where the lines do not determine a finite
// point.
std::optional<ImagePoint> fit_vanishing_circle(std::span<const ImageLine> lines);
std::optional<Eigen::Vector2d> fit_vanishing_circle_algebraic(std::span<const ImageLine> lines);

}  // namespace megablock
