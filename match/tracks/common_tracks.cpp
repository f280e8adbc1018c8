#include "match/tracks/common_tracks.h"

#include <algorithm>

#include "io/base/error.h"

namespace megablock {

std::vector<ImageSubset> rank_by_common_tracks(const TrackSet& tracks,
                                               const std::vector<std::vector<ImageIndex>>& subsets) {
  std::vector<ImageSubset> ranked;
  for (const std::vector<ImageIndex>& images : subsets) {
    if (images.empty()) throw InputError("a subset of images to rank by common tracks is empty");
    ImageSubset subset{images, 0};
    std::sort(subset.images.begin(), subset.images.end());
    subset.images.erase(std::unique(subset.images.begin(), subset.images.end()), subset.images.end());
    ranked.push_back(std::move(subset));
  }
  for (std::size_t t = 0; t + 1 < tracks.begin.size(); ++t) {
    const auto first = tracks.image.begin() + tracks.begin[t], last = tracks.image.begin() + tracks.begin[t + 1];
    for (ImageSubset& subset : ranked)
      subset.common_tracks += std::includes(first, last, subset.images.begin(), subset.images.end());
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.common_tracks > b.common_tracks; });
  return ranked;
}

}  // namespace megablock
