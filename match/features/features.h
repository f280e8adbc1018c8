// SIFT features of one image.
#pragma once

#include <string>

#include "io/block/block.h"
#include "io/block/features.h"

namespace megablock {

struct FeatureOptions {
  int max_features = 14000;           // per image, largest kept evenly over the image; 0 = all
  double max_megapixels = 25;         // larger images are reduced before detection (positions refer to the full image)
  double contrast_threshold = 0.007;  // of OpenCV's SIFT; lower = more features on weak texture
  bool root_sift = true;              // L1-normalise and square-root before quantising to bytes
  void check() const;                 // throws InputError
};

// Never throws for a bad file: `failure` says why there are no features (missing, empty, not an image, truncated).
ImageFeatures detect_features(const std::string& path, const std::string& mask_path, ImageIndex image,
                              const FeatureOptions& options);

}  // namespace megablock
