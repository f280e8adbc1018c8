#include <string>

#include "io/error.h"
#include "io/plausible.h"
#include "match/features.h"
#include "match/pair_matching.h"
#include "match/tracks.h"

namespace megablock {

void FeatureOptions::check() const {
  if (max_features < 0) throw InputError("max_features must be 0 (all) or more, not " + std::to_string(max_features));
  require_within(max_megapixels, {0.1, 1e5}, "max_megapixels");
  if (!(contrast_threshold >= 0 && contrast_threshold < 1)) {
    throw InputError("contrast_threshold must be in [0, 1)");
  }
}

void MatchOptions::check() const {
  constexpr Limits kMatchedAt{1e-3, 1e6};
  if (k_best < 1 || k_best > 7) throw InputError("k_best must be 1 to 7, not " + std::to_string(k_best));
  if (!(ratio > 0 && ratio <= 1)) throw InputError("ratio must be in (0, 1]");
  if (!(max_residual_px > 0 && max_residual_px <= 100)) throw InputError("max_residual_px must be in (0, 100]");
  if (!(sample_spacing_px >= 0 && sample_spacing_px <= 1000))
    throw InputError("sample_spacing_px must be in [0, 1000]");
  require_within(min_distance_m, kMatchedAt, "min_distance_m");
  require_within(max_distance_m, kMatchedAt, "max_distance_m");
  if (!(max_distance_m > min_distance_m)) throw InputError("max_distance_m must be more than min_distance_m");
  trust.check();
  if (!filter_model.empty() && !filter) throw InputError("filter_model needs 'filter: true', not false");
  if (min_inliers < 8) throw InputError("min_inliers must be at least 8, not " + std::to_string(min_inliers));
}

void TrackOptions::check() const {
  if (min_length < 2) throw InputError("min_track_length must be at least 2, not " + std::to_string(min_length));
}

}  // namespace megablock
