// Matches two images by k-best mutual nearest neighbours (Cannelle 2013), verified by two-view geometry.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "geometry/vanishing/interpretation_plane.h"
#include "io/block/block.h"
#include "io/block/features.h"
#include "match/pairs/upright_matching.h"
#include "match/verification/trusted_pair.h"

namespace megablock {

class MatchFilter;

// Settings of the stage 'match'.
struct MatchOptions {
  int k_best = 1;                // neighbours per feature: 1, or 3 for repeated facades
  double ratio = 0.85;           // a neighbour passes if its distance < ratio * distance of neighbour k + 1
  double max_residual_px = 3.0;  // largest epipolar (Sampson) residual of an inlier (see TwoViewOptions), pixels
  double sample_spacing_px = 0;  // smallest distance in the first image between points of a RANSAC sample
  int min_inliers = 20;          // fewest inliers of a pair that is kept, besides those that chance gives
  // For vertical images, compare only features that agree with the turn of the pair (turned_matching.h).
  bool by_turn = true;
  // For pairs whose relative orientation is trusted (trusted_pair.h):
  bool guided = false;          // compare only features near the epipolar line
  double min_distance_m = 2;    // smallest object distance that is matched in this way, metres
  double max_distance_m = 100;  // largest such distance, metres
  bool filter = false;          // drop matches that the filter considers wrong
  std::string filter_model;     // a model file of train-filter (YAML); empty: the model that comes with the program
  TrustOptions trust;
  void check() const;  // throws InputError
};

// Returns mutual matches (row in a, row in b), ascending. They are exact: the same as from comparing all pairs in
// integers.
std::vector<std::pair<std::int32_t, std::int32_t>> match_descriptors(const std::vector<SiftDescriptor>& a,
                                                                     const std::vector<SiftDescriptor>& b,
                                                                     const MatchOptions& options);

// The knowledge about a pair before it is matched.
struct PairKnowledge {
  std::optional<TrustedPair> orientation;
  const MatchFilter* filter = nullptr;  // null: no filtering
  // The vertical in the axes of each camera, pointing down (see TwoViewOptions).
  std::optional<AxisDirection> vertical_a = std::nullopt, vertical_b = std::nullopt;
  // Sectors of the features relative to the vertical (upright_sectors). If both are given, only features in like
  // sectors are compared. If the rotation of a verified pair then contradicts the verticals, the pair is matched again
  // without them.
  const std::vector<std::int8_t>*upright_a = nullptr, *upright_b = nullptr;
};

// Compares the sectors (upright_sectors) of the coarsest features of both images after matching these regardless of
// sectors.
Standing standing_of_coarsest(const ImageFeatures& a, const ImageFeatures& b, const std::vector<std::int8_t>& upright_a,
                              const std::vector<std::int8_t>& upright_b, const MatchOptions& options);

// Matches and verifies one pair; the model is kNone where it is not verified. A pair that cannot be verified along its
// trusted epipolar lines is matched without them. The result is deterministic; the two image indices are the seed.
// Throws InputError unless a.image < b.image.
VerifiedPair match_pair(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a, const Camera& camera_b,
                        const MatchOptions& options, const PairKnowledge& known = {});

}  // namespace megablock
