// Detects the SIFT features of one image (D. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV
// 60(2), 2004), evenly distributed and with bytes for descriptors.
#pragma once

#include <string>

#include "io/block/block.h"
#include "io/block/features.h"

namespace megablock {

struct FeatureOptions {
  int max_features = 14000;           // per image, the largest, evenly distributed; 0 = all
  double max_megapixels = 25;         // larger images are reduced before detection (positions refer to the full image)
  double contrast_threshold = 0.007;  // of OpenCV's SIFT; a lower one finds more features on weak texture
  bool root_sift = true;              // L1-normalise and take square roots before quantising to bytes
  void check() const;                 // throws InputError
};

// Returns the features of an image file, with positions in the full image (units of 2^-10 px, pixel centres at +0.5).
// `mask_path` may be empty. Does not throw for a bad file: `failure` then says why there are no features (missing,
// empty, not an image, truncated). Throws InputError for impossible options.
ImageFeatures detect_features(const std::string& path, const std::string& mask_path, ImageIndex image,
                              const FeatureOptions& options);

}  // namespace megablock
