// Straight edges of a picture, with the covariance of their lines (M13, M14).
//
// Where edges are is told by OpenCV's line segment detector (von Gioi, Jakubowicz, Morel and Randall, "LSD: a fast line
// segment detector with a false detection control", PAMI 32(4), 2010), whose ends say little of how good they are. So
// every edge is measured again: at each pixel along it, the place across it where the grey values of the smoothed
// picture change most, between pixels by a parabola through the logarithms of three gradients (a blurred step has a
// Gaussian gradient, of which the logarithm is a parabola). The line through these places, without strays, has their
// scatter for its sigma. Neighbouring places share pixels: their scatter's correlation from place to place, pooled over
// the picture, tells how many of them stand for one. Edges of buildings are not straight to hundredths of a pixel, and
// lenses bend them; `straightness_px` in each end is added to what the scatter lets expect.
#pragma once

#include <string>
#include <vector>

#include "geometry/vanishing/image_line.h"

namespace cv {
class Mat;
}

namespace megablock {

struct SegmentOptions {
  double min_length_px = 30;      // at the resolution looked at; shorter ones say nothing of a direction
  double max_megapixels = 4;      // larger pictures are reduced (lines refer to the full image)
  double straightness_px = 0.15;  // at the resolution looked at
  void check() const;             // throws InputError
};

struct LineSegment {
  Eigen::Vector2d first, second;  // px, pixel centres at +0.5
  ImageLine line;                 // origin: the upper left corner of the image
  double sigma_px = 0;            // scatter of the edge's places across it
};

// Of an 8-bit grey picture; mask as in projects (0 = ignore), empty: none. In the order of the detector.
std::vector<LineSegment> find_line_segments(const cv::Mat& grey, const cv::Mat& mask,
                                            const SegmentOptions& options = {});

}  // namespace megablock
