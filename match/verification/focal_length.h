// Estimates the focal length of a camera from matches of its images, before any image is oriented. It serves cameras
// whose focal length is a guess, or whose header may be wrong (an old lens on an adapter, a crop).
//
// The fundamental matrix F of two images needs no focal length. K' F K must be an essential matrix, which has one free
// singular value less than F; this is one equation for the focal length f (S. Bougnoux, ICCV 1998). Closed formulas are
// useless where the optical axes meet, which is how most people take photographs. So each pair tells its whole opinion
// here: with x_i the image points in pixels from the principal point,
//
//     c(f) = min over R, t of  sum_i rho(f r_i(x_a / f, x_b / f; R, t) / s),   rho(u) = u^2 / (1 + u^2),
//
// is the smallest robust cost of its matches for this focal length, on a logarithmic grid of f; r is the Sampson
// residual (geometry/two_view/sampson.h), and s three sigmas of the residuals of F. A plane contradicts no focal
// length: for each f an orientation explains its homography. It must also be found, or the pair would vote by the local
// minima of its cost; so the homography of most matches gives a start for each f, besides F and the neighbours on the
// grid.
//
// Some pairs have c with a narrow minimum, others only refuse focal lengths that are too long, and some are deceived by
// wrong matches or by errors that F takes up. So a pair contradicts f by at most one vote,
//
//     v(f) = min(1, (c(f) - min c) / ((16 + 0.15 n) u)),   u: the cost of one variance, n: matches,
//
// that is from four sigmas on, and from a share of all variances on, because the matches of two images have errors in
// common. The votes of all pairs are added. The focal length is where fewest pairs contradict, and its interval is
// where at most 5 % of the pairs, and at least one, contradict more than there. A given focal length is wrong where
// many more pairs contradict it.
//
// Lens distortion would pass for another focal length: 8 % in the corners move it by 18 %. So it is found first, from F
// alone, for all pairs of the camera together. The correction of an image point x at the radius r from the principal
// point is
//
//     x (1 + q r^2 / R^2)                                    (R: half the diagonal of the image),
//
// and q is where the fundamental matrices have most support. The pairs then tell f from corrected points.
//
// Images of nearly flat ground hardly tell q: their support is the same from barrel to pincushion, and its peak lies
// anywhere. With d_i, what a pair loses of its support by another q, that other one is as likely where
//
//     sum d_i <= 2 (sum d_i^2)^(1/2).
//
// A given focal length is wrong only where many pairs contradict it with every such q (likely_distortions()).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "geometry/two_view/point_pairs.h"

namespace megablock {

struct FocalLengthOptions {
  double max_residual_px = 3;              // largest Sampson residual of an inlier of F, pixels
  double min_ratio = 0.3, max_ratio = 15;  // range of the focal length, in larger sides of the image
  int min_inliers = 40;                    // fewest inliers of a pair that is asked
  int max_pairs = 40;                      // pairs that are asked, the first that have enough inliers
  int min_pairs = 5;                       // fewest such pairs
  int threads = 1;
  std::optional<double> distortion;  // q of the head of this file; none: found from the pairs
  void check() const;                // throws std::invalid_argument
};

// Two images of one camera.
struct MatchedImages {
  PointPairs pixels;       // matched points relative to the principal point, pixels; many may be wrong
  std::uint64_t seed = 0;  // of the random samples
};

struct FocalLength {
  double focal_px = 0;  // where fewest pairs contradict
  // The interval; its ends may be those of the range of focal lengths, min_ratio and max_ratio.
  double from_px = 0, to_px = 0;
  bool open = false;                   // the interval reaches an end of the range
  double distortion = 0;               // q of the head of this file
  int asked = 0;                       // pairs that have enough inliers, at most max_pairs
  std::vector<double> grid_px, votes;  // the votes against each focal length of the grid

  // Relative. The interval is taken as two sigmas to each side; the grid of focal lengths limits it to 1.25 %.
  double sigma() const;
  // How many more pairs contradict this focal length than focal_px. Beyond the grid it is that of the grid's end.
  double against(double focal_px) const;
};

// Gives the pairs [first, end) of a camera. They are matched only when they are asked for.
using MatchedBatch = std::function<std::vector<MatchedImages>(std::size_t first, std::size_t end)>;

// Estimates the focal length of a camera from `count` pairs of its images of `width` x `height` pixels. Empty where
// fewer than min_pairs have enough inliers. The result is deterministic and does not depend on the threads.
std::optional<FocalLength> focal_length_of(std::size_t count, const MatchedBatch& pairs, int width, int height,
                                           const FocalLengthOptions& options = {});

// The other distortions that the same pairs allow besides that of the estimate `found`, the nearest ones first.
std::vector<double> likely_distortions(std::size_t count, const MatchedBatch& pairs, int width, int height,
                                       const FocalLengthOptions& options, const FocalLength& found);

}  // namespace megablock
