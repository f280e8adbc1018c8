#include "io/evaluation/feature_statistics.h"

#include <algorithm>

namespace megablock {

IndexedVector<CameraIndex, FeatureStatistics> feature_statistics(const BlockResult& result) {
  IndexedVector<CameraIndex, FeatureStatistics> statistics(result.block.cameras.size());
  for (ImageIndex i(0); result.image_records.contains(i); ++i.value) {
    const std::int64_t features = result.image_records[i].features;
    if (features < 0) continue;
    FeatureStatistics& s = statistics[result.block.camera_of(i)];
    s.least = s.images == 0 ? features : std::min(s.least, features);
    s.most = std::max(s.most, features);
    s.total += features;
    ++s.images;
  }
  return statistics;
}

}  // namespace megablock
