// Finds the vertical in one image from its straight edges (Kalantari 2009, chapter 8): line segments, their vanishing
// points, and the vanishing point of the vertical. No other image is needed.
//
// A large image is searched in reduced form first, which takes a sixth of the time. An image that shows a vertical
// shows it there too, with fewer and longer edges (this held for all of 79 images). If the reduced image has no
// candidate at all, the full image is not searched.
#pragma once

#include <cstdint>
#include <string>

#include "geometry/vanishing/vertical.h"
#include "io/block/block.h"
#include "match/images/line_segments.h"

namespace megablock {

// The result for one image.
struct ImageVertical {
  std::string failure;                     // why the image could not be read; one line, empty on success
  int segments = 0, vanishing_points = 0;  // of the last search
  // The following is valid if `found`.
  bool found = false;
  // The vertical in camera axes, pointing down. Its covariance is that of the lines, multiplied by their variance
  // factor if that exceeds one.
  AxisDirection down;
  double roll = 0;  // deviation from the expected roll, in sigmas of the prior
  // Derivative of `down` by each parameter of the camera. An error of the camera moves the lines of all its images in
  // the same way, so the errors of their verticals are correlated.
  Eigen::Matrix3Xd by_camera;
  int lines = 0;  // number of lines through the vanishing point
  double variance_factor = 0;
  double log10_nfa = 0;
};

// `camera` is the camera of the image, which must have its size; its mask is applied. The result depends on the image,
// the camera, the options and the seed. Does not throw for a bad file; throws InputError for impossible options.
ImageVertical find_image_vertical(const std::string& path, const Camera& camera, const VerticalPrior& prior,
                                  std::uint64_t seed, const SegmentOptions& options = {});

}  // namespace megablock
