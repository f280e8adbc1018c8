// Vanishing points by circles in the image (Kalantari 2009, M24 to M30, M35): for comparison with vanishing_points.h,
// which has the same statistics and needs no origin. A point comes as a pixel, so that one at infinity itself is none.
//
// The feet H of the perpendiculars from an origin O to lines that meet in P lie on the circle of diameter OP: its
// centre is K = P / 2, its radius |K|, and |K - H| - |K| = 0. By |H|^2 = P'H two feet give a circle through O. With rho
// the line's distance from O and n its normal the residual is
//
//     |K - H| - |K| = (|H|^2 - 2 K'H) / (|K - H| + |K|) = rho (rho - n'P) / (|K - H| + |K|),
//
// computed by the second form, as |K| may be far larger than |H|. Lines near O fit every circle: those with |rho|
// below 3 sigma or 2 % of the diagonal are left out (M35).
//
//   band     median of the larger half axes of the feet's error ellipses (M28).
//   search   as in vanishing_points.h, by pairs of feet. A line without reason has theta and rho anywhere in the
//            image; the probability p of the stop is the share of (theta, rho) in the band of the circle at hand.
//   fit      w |H|^2 = (w P)'H as a null vector in units of the feet's distances, which P at infinity does not disturb
//            (M26), then Gauss-Helmert with the covariances of the lines in the direction of P and the inverse of its
//            distance (M27, M30), which are normally distributed where P, close to infinity, is not.
//   origin   the upper left corner, then the barycentre of the centres of the circles so found, from where they cross
//            at large angles (M29).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/interpretation_plane.h"

namespace megablock {

struct CircleOptions {
  double max_log10_nfa = -4;
  int min_draws = 1000;
  double max_theta_sigma = 0.5 * kDegree;  // radians
  std::uint64_t seed = 1;                  // of the image
};

struct CirclePoint {
  ImagePoint point;
  double log10_nfa = 0;
  std::vector<int> lines;
};

// Vanishing points of an image of this size, px. Those whose fit does not end are left out.
std::vector<CirclePoint> find_vanishing_points_by_circles(std::span<const ImageLine> lines, int width, int height,
                                                          const CircleOptions& options = {});

// The point in which lines meet, and by the algebraic fit alone. Origin: that of the lines; those within three sigmas
// of it are left out.
std::optional<ImagePoint> fit_vanishing_circle(std::span<const ImageLine> lines);
std::optional<Eigen::Vector2d> fit_vanishing_circle_algebraic(std::span<const ImageLine> lines);

}  // namespace megablock
