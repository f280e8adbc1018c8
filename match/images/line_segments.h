// Finds straight edges in an image, with the covariance of their lines (Kalantari 2009, chapter 2).
//
// OpenCV's line segment detector finds the edges (R. Grompone von Gioi, J. Jakubowicz, J.-M. Morel and G. Randall,
// "LSD: a fast line segment detector with a false detection control", IEEE PAMI 32(4), 2010). It does not say how
// accurate its end points are, so every edge is measured again. At each pixel along the edge, the position across it is
// that of the steepest change of the smoothed grey values, interpolated by a parabola through the logarithms of three
// gradients (the gradient of a blurred step is a Gaussian, and its logarithm a parabola). The line is fitted to these
// points without outliers; their scatter gives its standard deviation.
//
// Neighbouring points share pixels. The correlation of their scatter, pooled over the image, tells how many of them are
// worth one independent point. Edges of buildings are not straight to hundredths of a pixel, and lenses bend them, so
// `straightness_px` at each end is added to the covariance.
#pragma once

#include <string>
#include <vector>

#include "geometry/vanishing/image_line.h"

namespace cv {
class Mat;
}

namespace megablock {

struct SegmentOptions {
  double min_length_px = 30;      // in the reduced image; shorter segments do not determine a direction
  double max_megapixels = 4;      // larger images are reduced (lines refer to the full image)
  double straightness_px = 0.15;  // in the reduced image
  void check() const;             // throws InputError
};

struct LineSegment {
  Eigen::Vector2d first, second;  // end points, pixels, pixel centres at +0.5
  ImageLine line;                 // origin: upper left corner of the image
  double sigma_px = 0;            // scatter of the edge points across the line, pixels of the full image
};

// Returns the segments of an 8-bit grey image in the order of the detector. In the mask 0 means ignore, as in projects;
// an empty mask masks nothing.
std::vector<LineSegment> find_line_segments(const cv::Mat& grey, const cv::Mat& mask,
                                            const SegmentOptions& options = {});

}  // namespace megablock
