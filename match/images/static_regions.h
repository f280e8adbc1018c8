// Finds the regions of a camera's images that never change, which show the vehicle that carries the camera. They become
// its mask (Cannelle 2013 draws such masks by hand and suggests this search).
//
// From every image the gradients g = grad ln(I + c) of its reduced grey values I are kept. Neither the exposure nor the
// light on a plain surface changes them. Over the images k, at every pixel p,
//
//     m(p) = median_k g_k(p),    v_q(p) = q-quantile over k of |g_k(p) - m(p)|.
//
// Where the images show the scene, the variation v is large; where they show the vehicle, it is the noise of the
// sensor. It is also small where most images show sky. But the border of the sky moves with the roofs, so there v_0.8
// exceeds the noise in a wide band before v_0.5 does, while at the silhouette of the vehicle both grow at the same
// place. Hence
//
//     still      v_0.8 < t        t a share of the typical v_0.5 of the image
//     structure  still and |m| > t: an edge that is there in all images
//
// A connected piece that is still, but is no structure, belongs to the vehicle when most of its rim is structure or
// changes in the median image too (v_0.5 >= t). The mask consists of these pieces and the structure, closed, without
// small regions.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace megablock {

struct StaticRegionOptions {
  int width_px = 480;             // larger side of the reduced images
  int min_images = 20;            // of a camera; fewer are refused
  int max_images = 100;           // at most so many images, spread evenly over those of the camera
  double min_distance_m = 2;      // between two images, where positions are known: a waiting vehicle sees a still scene
  double variation_share = 0.25;  // t over the upper quartile of v_0.5
  double firm_rim = 0.7;          // share of a piece's rim, except image borders, that must be firm
  double min_area = 5e-4;         // share of the image; smaller regions are left out
  int margin_px = 1;              // by which regions are widened, reduced pixels
  void check() const;             // throws InputError
};

// Collects images of one camera; mask() evaluates them.
class StaticRegionFinder {
 public:
  explicit StaticRegionFinder(const StaticRegionOptions& options);

  // The gradients of one 8-bit grey image as they are stored. May be called from several threads.
  cv::Mat gradients(const cv::Mat& grey) const;
  // Adds the gradients of an image of this size (pixels). Throws InputError if the size differs from that of the
  // others.
  void add(cv::Mat gradients, const cv::Size& image_size);
  int images() const { return static_cast<int>(gradients_.size()); }

  // The mask in the form that a project takes: 8 bit, 0 in regions that never change, 255 elsewhere, of the size of the
  // images. Throws InputError for fewer than min_images images.
  cv::Mat mask() const;

 private:
  StaticRegionOptions options_;
  cv::Size image_size_;
  std::vector<cv::Mat> gradients_;  // CV_16SC2
};

}  // namespace megablock
