// Holds the features of an image and the matches of a pair of images, as match/ makes them and the store keeps them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/base/index.h"

namespace megablock {

// A SIFT keypoint.
struct Keypoint {
  std::int32_t x, y;  // units of 2^-10 px, pixel centres at +0.5
  float scale_px;     // diameter of the SIFT region
  float angle_deg;
};

using SiftDescriptor = std::array<std::uint8_t, 128>;

struct ImageFeatures {
  ImageIndex image;
  std::int32_t width = 0, height = 0;  // of the decoded image, pixels; 0 if it failed
  // The grey values of the file that all but a thousandth of its pixels keep to on either side.
  std::array<float, 2> grey_range{};
  std::vector<Keypoint> keypoints;     // by falling scale, then by x and y
  std::vector<SiftDescriptor> descriptors;
  std::array<float, 128> global_descriptor{};  // unit norm; finds neighbours of images without a position
  std::string failure;                         // the reason why the image has no features; empty if it has
};

// The geometric model that verifies the matches of a pair.
enum class PairModel : std::uint8_t { kNone = 0, kEssential = 1, kHomography = 2, kRotationOnly = 3 };

// Relative orientation of camera b with respect to camera a: X_b = R X_a + t with |t| = 1 (t = 0 for a rotation only).
struct PairOrientation {
  std::array<double, 4> rotation_wxyz{1, 0, 0, 0};
  std::array<double, 3> translation{};
  // Upper triangles of covariances, by rows. The first is that of the increment w of R Exp(w), axes of a, rad^2; all
  // zeros if unknown. The second is that of the translation, which keeps its length, axes of b. An undetermined base
  // has a sigma of pi.
  std::array<double, 6> rotation_covariance{}, base_covariance{};
};

// A verified pair of images; a < b always.
struct VerifiedPair : PairOrientation {
  ImageIndex a, b;
  PairModel model = PairModel::kNone;
  double median_angle_deg = 0;                     // median intersection angle of the inlier rays
  std::vector<std::int32_t> feature_a, feature_b;  // inlier matches as rows of the features, ascending by feature_a
  std::int32_t putative = 0;                       // number of matches before verification
  bool ill_conditioned = false;                    // the matches hardly determine the direction of the base
  // Explains the matches of a plane nearly as well; other pairs decide between the two.
  std::optional<PairOrientation> twin;
};

}  // namespace megablock
