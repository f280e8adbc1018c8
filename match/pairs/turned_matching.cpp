#include "match/pairs/turned_matching.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/binomial.h"
#include "match/pairs/upright_matching.h"

namespace megablock {

namespace {

// Change of orientation and size from a feature of a to its match in b.
struct Change {
  double turn_rad;
  double octaves;  // log2 of the ratio of sizes
};

using ChangesBySector = std::array<std::vector<Change>, kUprightSectors>;

// The changes of all matches, sorted by the sector of their turn.
ChangesBySector changes_of(const ImageFeatures& a, const ImageFeatures& b,
                           std::span<const std::pair<std::int32_t, std::int32_t>> matches) {
  ChangesBySector changes;
  for (const auto& [row_a, row_b] : matches) {
    const Keypoint& of_a = a.keypoints[static_cast<std::size_t>(row_a)];
    const Keypoint& of_b = b.keypoints[static_cast<std::size_t>(row_b)];
    const Change change{(of_b.angle_deg - of_a.angle_deg) * kDegree, std::log2(of_b.scale_px / of_a.scale_px)};
    const std::int8_t sector = sector_of(change.turn_rad);
    if (sector != kAnySector && std::isfinite(change.octaves))
      changes[static_cast<std::size_t>(sector)].push_back(change);
  }
  return changes;
}

// Whether most changes of size are equal. In the street block "lund" no pair has so many so near; of pairs of vertical
// images four of five have.
bool are_of_one_size(std::vector<Change> changes) {
  constexpr double kNear = 0.2, kShare = 0.7;  // in octaves; 0.2 is 15 %
  const auto middle = changes.begin() + std::ssize(changes) / 2;
  std::nth_element(changes.begin(), middle, changes.end(),
                   [](const Change& p, const Change& q) { return p.octaves < q.octaves; });
  const double median = middle->octaves;
  const auto near = std::count_if(changes.begin(), changes.end(),
                                  [&](const Change& c) { return std::abs(c.octaves - median) <= kNear; });
  return static_cast<double>(near) >= kShare * static_cast<double>(changes.size());
}

// The mean direction of the turns.
double mean_turn(const std::vector<Change>& changes) {
  double cosines = 0, sines = 0;
  for (const Change& change : changes) {
    cosines += std::cos(change.turn_rad);
    sines += std::sin(change.turn_rad);
  }
  return std::atan2(sines, cosines);
}

}  // namespace

std::optional<double> turn_from_above(const ImageFeatures& a, const ImageFeatures& b,
                                      std::span<const std::pair<std::int32_t, std::int32_t>> matches) {
  constexpr double kLog10Chance = -3;
  constexpr std::size_t kTogether = 3;
  const ChangesBySector changes = changes_of(a, b, matches);
  std::size_t count = 0;
  // The largest number of changes within three adjacent sectors.
  std::vector<Change> most;
  for (std::size_t sector = 0; sector < kUprightSectors; ++sector) {
    count += changes[sector].size();
    std::vector<Change> together;
    for (std::size_t next = sector; next < sector + kTogether; ++next) {
      const std::vector<Change>& some = changes[next % kUprightSectors];
      together.insert(together.end(), some.begin(), some.end());
    }
    if (together.size() > most.size()) most = std::move(together);
  }
  const double log10_chance =
      std::log10(kUprightSectors) + log10_binomial_tail(static_cast<std::int64_t>(count), std::ssize(most),
                                                        static_cast<double>(kTogether) / kUprightSectors);
  if (!(log10_chance < kLog10Chance) || !are_of_one_size(most)) return std::nullopt;
  return mean_turn(most);
}

std::vector<std::int8_t> sectors_from(const ImageFeatures& image, double direction_rad) {
  std::vector<std::int8_t> sectors;
  sectors.reserve(image.keypoints.size());
  for (const Keypoint& keypoint : image.keypoints)
    sectors.push_back(sector_of(keypoint.angle_deg * kDegree - direction_rad));
  return sectors;
}

}  // namespace megablock
