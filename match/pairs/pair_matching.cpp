#include "match/pairs/pair_matching.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/block/tracks.h"
#include "io/text/plausible.h"
#include "match/filter/match_filter.h"
#include "match/nearest/nearest.h"
#include "match/pairs/guided_matching.h"
#include "match/pairs/turned_matching.h"
#include "match/verification/two_view.h"

namespace megablock {

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

namespace {

// Number of the first k neighbours of a row that pass the ratio test against neighbour k + 1.
std::size_t accepted(const Neighbours& neighbours, std::size_t row, double ratio) {
  const std::size_t k = neighbours.k - 1;
  const std::int32_t* distance = neighbours.distance.data() + row * neighbours.k;
  const double limit = ratio * ratio * distance[k];
  std::size_t count = 0;
  while (count < k && distance[count] < limit && distance[count] < Neighbours::kFar) ++count;
  return count;
}

// Whether `other` is among the accepted neighbours of a row.
bool accepts(const Neighbours& neighbours, std::size_t row, std::int32_t other, double ratio) {
  const auto first = neighbours.row.begin() + static_cast<std::ptrdiff_t>(row * neighbours.k);
  const auto last = first + static_cast<std::ptrdiff_t>(accepted(neighbours, row, ratio));
  return std::find(first, last, other) != last;
}

using Matches = std::vector<std::pair<std::int32_t, std::int32_t>>;

struct PositionedMatches {
  Matches matches;
  PointPairs points;
};

std::optional<Eigen::Vector2d> normalised_point(const Camera& camera, const Keypoint& k) {
  return unproject(camera.intrinsics, {from_fixed_pixel(k.x), from_fixed_pixel(k.y)});
}

// Matches with their normalised image points. SIFT may give one position several orientations; the same pair of
// positions counts once.
PositionedMatches position(const Matches& matches, const ImageFeatures& a, const ImageFeatures& b,
                           const Camera& camera_a, const Camera& camera_b) {
  std::vector<std::tuple<std::int32_t, std::int32_t, std::int32_t, std::int32_t, std::size_t>> places;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Keypoint& ka = a.keypoints[static_cast<std::size_t>(matches[i].first)];
    const Keypoint& kb = b.keypoints[static_cast<std::size_t>(matches[i].second)];
    places.emplace_back(ka.x, ka.y, kb.x, kb.y, i);
  }
  std::sort(places.begin(), places.end());
  const auto same_place = [](const auto& p, const auto& q) {
    return std::get<0>(p) == std::get<0>(q) && std::get<1>(p) == std::get<1>(q) && std::get<2>(p) == std::get<2>(q) &&
           std::get<3>(p) == std::get<3>(q);
  };
  places.erase(std::unique(places.begin(), places.end(), same_place), places.end());
  std::vector<std::size_t> rows;
  for (const auto& p : places) rows.push_back(std::get<4>(p));
  std::sort(rows.begin(), rows.end());

  PositionedMatches result;
  for (const std::size_t i : rows) {
    const auto pa = normalised_point(camera_a, a.keypoints[static_cast<std::size_t>(matches[i].first)]);
    const auto pb = normalised_point(camera_b, b.keypoints[static_cast<std::size_t>(matches[i].second)]);
    if (!pa || !pb) continue;  // beyond the radius where the distortion can be inverted
    result.matches.push_back(matches[i]);
    result.points.a.push_back(*pa);
    result.points.b.push_back(*pb);
  }
  return result;
}

// SIFT gives a keypoint with several orientations one row for each, one after the other. Matches name only the first of
// these rows, because all belong to one point.
std::int32_t first_at_place(const std::vector<Keypoint>& keypoints, std::int32_t row) {
  const auto at = [&](std::int32_t r) { return keypoints[static_cast<std::size_t>(r)]; };
  while (row > 0 && at(row - 1).x == at(row).x && at(row - 1).y == at(row).y) --row;
  return row;
}

// Matches that pass the ratio test in both directions.
Matches mutual_matches(const MutualNeighbours& nearest, double ratio) {
  Matches matches;
  for (std::size_t row = 0; row < nearest.of_a.row.size() / nearest.of_a.k; ++row) {
    const std::size_t count = accepted(nearest.of_a, row, ratio);
    for (std::size_t i = 0; i < count; ++i) {
      const std::int32_t other = nearest.of_a.row[row * nearest.of_a.k + i];
      const auto this_row = static_cast<std::int32_t>(row);
      if (accepts(nearest.of_b, static_cast<std::size_t>(other), this_row, ratio))
        matches.emplace_back(this_row, other);
    }
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

// A seed that depends only on the pair, so that its result does not depend on the order of work.
std::uint64_t pair_seed(ImageIndex a, ImageIndex b) { return Hasher().add(a.value).add(b.value).value(); }

}  // namespace

Matches match_descriptors(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                          const MatchOptions& options) {
  options.check();
  return mutual_matches(nearest_neighbours(a, b, static_cast<std::size_t>(options.k_best) + 1), options.ratio);
}

namespace {

// Matches of the coarsest features, which come first in the list.
Matches match_coarsest(const ImageFeatures& a, const ImageFeatures& b, const MatchOptions& options) {
  static constexpr std::size_t kCoarsest = 1000;
  const auto coarsest = [](const ImageFeatures& image) {
    const auto first = image.descriptors.begin();
    return std::vector<SiftDescriptor>(
        first, first + static_cast<std::ptrdiff_t>(std::min(kCoarsest, image.descriptors.size())));
  };
  return match_descriptors(coarsest(a), coarsest(b), options);
}

}  // namespace

Standing standing_of_coarsest(const ImageFeatures& a, const ImageFeatures& b, const std::vector<std::int8_t>& upright_a,
                              const std::vector<std::int8_t>& upright_b, const MatchOptions& options) {
  return compare_standing(match_coarsest(a, b, options), upright_a, upright_b);
}

namespace {

// Matches of features in equal or adjacent sectors (upright_matching.h).
Matches match_alike(const ImageFeatures& a, const ImageFeatures& b, const std::vector<std::int8_t>& sectors_a,
                    const std::vector<std::int8_t>& sectors_b, const MatchOptions& options) {
  const auto k = static_cast<std::size_t>(options.k_best) + 1;
  return mutual_matches(nearest_alike(a.descriptors, b.descriptors, sectors_a, sectors_b, k), options.ratio);
}

// Matches of descriptors in the fastest way that is safe: by known verticals, by the turn of a pair of vertical images,
// or all with all.
Matches match_features(const ImageFeatures& a, const ImageFeatures& b, const MatchOptions& options,
                       const PairKnowledge& known) {
  if (known.upright_a && known.upright_b) return match_alike(a, b, *known.upright_a, *known.upright_b, options);
  if (options.by_turn)
    if (const auto turn = turn_from_above(a, b, match_coarsest(a, b, options)))
      return match_alike(a, b, sectors_from(a, 0), sectors_from(b, *turn), options);
  return match_descriptors(a.descriptors, b.descriptors, options);
}

// Verifies matches by two-view geometry and stores the inliers. `by_chance`: see TwoViewOptions.
VerifiedPair verify(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a, const Camera& camera_b,
                    const MatchOptions& options, const Matches& matches, const PairKnowledge& known, double by_chance) {
  VerifiedPair pair;
  pair.a = a.image;
  pair.b = b.image;
  pair.putative = static_cast<std::int32_t>(matches.size());
  const PositionedMatches positioned = position(matches, a, b, camera_a, camera_b);

  TwoViewOptions two_view;
  const double focal = 0.5 * (camera_a.intrinsics[kFocal] + camera_b.intrinsics[kFocal]);
  // The geometry works in normalised coordinates, in which a pixel is 1 / focal length.
  two_view.max_residual = options.max_residual_px / focal;
  two_view.sample_spacing = options.sample_spacing_px / camera_a.intrinsics[kFocal];
  two_view.min_inliers = options.min_inliers;
  two_view.by_chance = by_chance;
  two_view.seed = pair_seed(a.image, b.image);
  two_view.vertical_a = known.vertical_a;
  two_view.vertical_b = known.vertical_b;
  const TwoView found = estimate_two_view(positioned.points, two_view);
  if (found.model == PairModel::kNone) return pair;

  set_orientation(pair, found);
  for (std::size_t i = 0; i < positioned.matches.size(); ++i) {
    if (!found.inlier[i]) continue;
    pair.feature_a.push_back(first_at_place(a.keypoints, positioned.matches[i].first));
    pair.feature_b.push_back(first_at_place(b.keypoints, positioned.matches[i].second));
  }
  return pair;
}

// Whether the rotation of the pair turns one vertical away from the other by more than half a sector of 30 degrees.
// Matches may then have been missed, because features were compared by sectors.
bool contradicts_verticals(const VerifiedPair& pair, const PairKnowledge& known) {
  constexpr double kFarthest = 15 * kDegree;
  if (pair.model == PairModel::kNone || !known.vertical_a || !known.vertical_b) return false;
  const auto& [w, x, y, z] = pair.rotation_wxyz;
  const Eigen::Vector3d turned = Eigen::Quaterniond(w, x, y, z) * known.vertical_a->direction;
  return turned.dot(known.vertical_b->direction) < std::cos(kFarthest);
}

Eigen::Vector2d pixel(const ImageFeatures& image, std::int32_t row) {
  const Keypoint& k = image.keypoints[static_cast<std::size_t>(row)];
  return {from_fixed_pixel(k.x), from_fixed_pixel(k.y)};
}

// Removes the matches that the filter considers wrong. A pair that keeps too few is not verified any more.
void drop_wrong(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a, const Camera& camera_b,
                const MatchOptions& options, const TrustedPair& orientation, const MatchFilter& filter,
                VerifiedPair& pair) {
  std::vector<MatchSample> samples;
  for (std::size_t i = 0; i < pair.feature_a.size(); ++i) {
    const auto sample =
        match_sample(orientation, camera_a, pixel(a, pair.feature_a[i]), camera_b, pixel(b, pair.feature_b[i]));
    samples.push_back(sample.value_or(MatchSample{}));  // verified matches have rays
  }
  const std::vector<std::uint8_t> right = filter.right(samples);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < right.size(); ++i) {
    if (!right[i]) continue;
    pair.feature_a[kept] = pair.feature_a[i];
    pair.feature_b[kept++] = pair.feature_b[i];
  }
  pair.feature_a.resize(kept);
  pair.feature_b.resize(kept);
  if (static_cast<int>(kept) >= options.min_inliers) return;
  pair.model = PairModel::kNone;
  pair.feature_a.clear();
  pair.feature_b.clear();
}

}  // namespace

VerifiedPair match_pair(const ImageFeatures& a, const ImageFeatures& b, const Camera& camera_a, const Camera& camera_b,
                        const MatchOptions& options, const PairKnowledge& known) {
  if (!(a.image < b.image)) throw InputError("match_pair: the first image must have the lower index of the two");
  VerifiedPair pair;
  // With a trusted orientation only the epipolar band is searched; if that fails, the trust may be misplaced and the
  // pair is matched without it.
  if (known.orientation && options.guided) {
    const GuidedMatches guided = match_along_epipolar(a, b, camera_a, camera_b, *known.orientation, options);
    // Wrong matches lie anywhere in the band, so this share of them fits by chance.
    const double by_chance = std::min(1.0, options.max_residual_px / std::max(1.0, guided.half_width_px));
    pair = verify(a, b, camera_a, camera_b, options, guided.matches, known, by_chance);
  }
  const auto compare = [&](const PairKnowledge& knowing) {
    return verify(a, b, camera_a, camera_b, options, match_features(a, b, options, knowing), knowing, 0);
  };
  if (pair.model == PairModel::kNone) {
    pair = compare(known);
    if (known.upright_a && known.upright_b && contradicts_verticals(pair, known))
      pair = compare({.orientation = known.orientation, .filter = known.filter});
  }
  if (known.orientation && known.filter && pair.model != PairModel::kNone)
    drop_wrong(a, b, camera_a, camera_b, options, *known.orientation, *known.filter, pair);
  return pair;
}

}  // namespace megablock
