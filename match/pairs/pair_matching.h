// k-best mutual matching of two images and its verification by two-view geometry.
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

struct MatchOptions {
  int k_best = 1;                // neighbours kept per feature: 1, or 3 on repeated facades (CN-12)
  double ratio = 0.85;           // a neighbour passes when its distance < ratio x distance of neighbour k + 1
  double max_residual_px = 3.0;  // of verification: largest epipolar (Sampson) residual (see TwoViewOptions)
  double sample_spacing_px = 0;  // least distance of the points of a sample of verification in the first image
  int min_inliers = 20;          // fewer: the pair is not verified
  bool by_turn = true;           // from above, only features that agree in the turn of the pair (turned_matching.h)
  // Of pairs whose relative orientation is trusted (trusted_pair.h).
  bool guided = false;          // only features near the epipolar line are compared
  double min_distance_m = 2;    // of what is matched so, and
  double max_distance_m = 100;  // at most
  bool filter = false;          // matches that the filter takes for wrong are dropped
  std::string filter_model;     // YAML of train-filter; empty: the one that comes with the program
  TrustOptions trust;
  void check() const;  // throws InputError
};

// Mutual matches (row in a, row in b), ascending. Exact: the same as comparing all pairs with integer arithmetic.
std::vector<std::pair<std::int32_t, std::int32_t>> match_descriptors(const std::vector<SiftDescriptor>& a,
                                                                     const std::vector<SiftDescriptor>& b,
                                                                     const MatchOptions& options);

// What is known of a pair before it is matched.
struct PairKnowledge {
  std::optional<TrustedPair> orientation;
  const MatchFilter* filter = nullptr;  // none: nothing is filtered
  // The vertical in the axes of each camera, pointing down (TwoViewOptions).
  std::optional<AxisDirection> vertical_a = std::nullopt, vertical_b = std::nullopt;
  // How their features stand to it (upright_sectors); where both are given, only features that stand alike are
  // compared. A pair that is verified so, and whose rotation then contradicts the verticals, is matched again without.
  const std::vector<std::int8_t>*upright_a = nullptr, *upright_b = nullptr;
};

// How the coarsest features of both images stand to each other, by their sectors (upright_sectors).
Standing standing_of_coarsest(const ImageFeatures& a, const ImageFeatures& b, const std::vector<std::int8_t>& upright_a,
                              const std::vector<std::int8_t>& upright_b, const MatchOptions& options);

// Matches and verifies one pair; model kNone when it does not pass. Deterministic: seeded by the two image indices. A
// pair that cannot be verified along its trusted epipolar lines is matched without them.
VerifiedPair match_pair(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a, const Camera& camera_b,
                        const MatchOptions& options, const PairKnowledge& known = {});

}  // namespace megablock
