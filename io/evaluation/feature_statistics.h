// Gives statistics of the number of interest points in the images of each camera.
#pragma once

#include "io/result/result.h"

namespace megablock {

// Counts only images whose number of interest points is known.
struct FeatureStatistics {
  std::int64_t images = 0, least = 0, most = 0, total = 0;
  double mean() const { return images > 0 ? static_cast<double>(total) / static_cast<double>(images) : 0; }
};
IndexedVector<CameraIndex, FeatureStatistics> feature_statistics(const BlockResult& result);

}  // namespace megablock
