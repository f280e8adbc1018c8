// Regions of a camera's images that never change: the vehicle that carries it (CN-10).
//
// Of every image the gradients g = grad ln(I + c) of its reduced grey values are kept, which neither exposure nor the
// light on a plain surface changes. Over the images k, for every pixel p,
//
//     m(p) = median_k g_k(p),    v_q(p) = q-quantile over k of |g_k(p) - m(p)|.
//
// The scene has a large variation v, the vehicle the noise of the sensor. So has what is mostly sky; but its border
// wanders with the roofs, so that v grows through a wide band from v_0.8 to v_0.5, where at the vehicle's silhouette
// both grow at once. Hence
//
//     still      v_0.8 < t        t a share of the typical v_0.5 of the image
//     structure  still and |m| > t: an edge that is there in all images
//
// and a connected piece of what is still and no structure belongs to the vehicle when most of its rim is structure or
// changes in the median image too (v_0.5 >= t). The mask is these pieces with the structure, closed and without specks.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace megablock {

struct StaticRegionOptions {
  int width_px = 480;             // larger side of the reduced images
  int min_images = 20;            // of a camera; fewer tell nothing
  int max_images = 100;           // looked at, spread evenly over those of the camera
  double min_distance_m = 2;      // between two of them, where positions are known: a waiting vehicle sees still scenes
  double variation_share = 0.25;  // t over the upper quartile of v_0.5
  double firm_rim = 0.7;          // share of a piece's rim, image borders apart, that must be firm
  double min_area = 5e-4;         // of the image; smaller regions are left out
  int margin_px = 1;              // by which regions are widened, reduced pixels
  void check() const;             // throws InputError
};

class StaticRegionFinder {
 public:
  explicit StaticRegionFinder(const StaticRegionOptions& options);

  // Gradients of one image (8-bit grey), in the form in which they are kept.
  cv::Mat gradients(const cv::Mat& grey) const;
  // Images of one size; InputError for another.
  void add(cv::Mat gradients, const cv::Size& image_size);
  int images() const { return static_cast<int>(gradients_.size()); }

  // As a project takes masks: 8 bit, 0 in regions that never change, else 255, of the images' size. InputError below
  // min_images images.
  cv::Mat mask() const;

 private:
  StaticRegionOptions options_;
  cv::Size image_size_;
  std::vector<cv::Mat> gradients_;  // CV_16SC2
};

}  // namespace megablock
