// Features of one image as match/ makes them and the store keeps them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/base/index.h"

namespace megablock {

struct Keypoint {
  std::int32_t x, y;  // 2^-10 px, pixel centres at +0.5
  float scale_px;     // diameter of the SIFT region
  float angle_deg;
};

using SiftDescriptor = std::array<std::uint8_t, 128>;

struct ImageFeatures {
  ImageIndex image;
  std::int32_t width = 0, height = 0;  // of the decoded image, px; 0 when it failed
  std::vector<Keypoint> keypoints;     // sorted by decreasing scale, then x, then y
  std::vector<SiftDescriptor> descriptors;
  std::array<float, 128> global_descriptor{};  // unit norm; for candidate neighbours of images without position
  std::string failure;                         // why the image has no features; empty when it has
};

// One matched pair of images; a.value < b.value always.
enum class PairModel : std::uint8_t { kNone = 0, kEssential = 1, kHomography = 2, kRotationOnly = 3 };

// Relative orientation of camera b with respect to camera a: X_b = R (X_a) + t, |t| = 1 (t = 0 when rotation-only).
struct PairOrientation {
  std::array<double, 4> rotation_wxyz{1, 0, 0, 0};
  std::array<double, 3> translation{};
  // Upper triangles by rows: of the increment w of R Exp(w), axes of a, rad^2, all zero where it is not known; of the
  // translation, which keeps its length, axes of b. A base that is open has a sigma of pi.
  std::array<double, 6> rotation_covariance{}, base_covariance{};
};

struct VerifiedPair : PairOrientation {
  ImageIndex a, b;
  PairModel model = PairModel::kNone;
  double median_angle_deg = 0;                     // of intersection of the inlier rays
  std::vector<std::int32_t> feature_a, feature_b;  // inlier matches, rows in the features; ascending feature_a
  std::int32_t putative = 0;                       // matches before verification
  bool ill_conditioned = false;                    // the matches hardly determine the direction of the base
  std::optional<PairOrientation> twin;             // explains the matches of a plane nearly as well; others decide
};

}  // namespace megablock
