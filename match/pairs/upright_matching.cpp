#include "match/pairs/upright_matching.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "geometry/camera/camera.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/binomial.h"
#include "io/block/tracks.h"

namespace megablock {

namespace {

// The turn from sector a to sector b, 0 to kUprightSectors - 1.
int turn_between(std::int8_t a, std::int8_t b) { return (b - a + kUprightSectors) % kUprightSectors; }

// Whether features in these sectors are compared: equal or adjacent sectors, or one without a sector.
bool stand_alike(std::int8_t a, std::int8_t b) {
  if (a == kAnySector || b == kAnySector) return true;
  const int turn = turn_between(a, b);
  return turn <= 1 || turn == kUprightSectors - 1;
}

// The descriptors of the given rows.
std::vector<SiftDescriptor> picked(const std::vector<SiftDescriptor>& descriptors,
                                   const std::vector<std::int32_t>& rows) {
  std::vector<SiftDescriptor> result;
  result.reserve(rows.size());
  for (const std::int32_t row : rows) result.push_back(descriptors[static_cast<std::size_t>(row)]);
  return result;
}

Neighbours no_neighbours(std::size_t rows, std::size_t k) {
  return {k, std::vector<std::int32_t>(rows * k, Neighbours::kFar), std::vector<std::int32_t>(rows * k, -1)};
}

// Inserts a neighbour into the list of a row, in order of distance, then of row.
void insert_neighbour(Neighbours& all, std::size_t of, std::int32_t distance, std::int32_t row) {
  const std::size_t first = of * all.k;
  std::size_t place = all.k;
  while (place > 0) {
    const std::size_t before = first + place - 1;
    if (all.row[before] >= 0 && std::pair(all.distance[before], all.row[before]) < std::pair(distance, row)) break;
    if (place < all.k) {
      all.distance[before + 1] = all.distance[before];
      all.row[before + 1] = all.row[before];
    }
    --place;
  }
  if (place == all.k) return;
  all.distance[first + place] = distance;
  all.row[first + place] = row;
}

}  // namespace

std::int8_t sector_of(double angle_rad) {
  const double turns = angle_rad / (2 * std::numbers::pi), part = turns - std::floor(turns);
  if (!(part >= 0)) return kAnySector;
  return static_cast<std::int8_t>(std::min<int>(kUprightSectors - 1, static_cast<int>(part * kUprightSectors)));
}

std::vector<std::int8_t> upright_sectors(const ImageFeatures& image, const Camera& camera,
                                         const Eigen::Vector3d& down) {
  constexpr double kLowest = 0.5, kHighest = -0.866;  // sines of 30 degrees below the horizon and of 60 degrees above
  constexpr double kStep = 1e-3;
  std::vector<std::int8_t> sectors(image.keypoints.size(), kAnySector);
  for (std::size_t i = 0; i < sectors.size(); ++i) {
    const Keypoint& keypoint = image.keypoints[i];
    const Eigen::Vector2d pixel(from_fixed_pixel(keypoint.x), from_fixed_pixel(keypoint.y));
    const auto point = unproject(camera.intrinsics, pixel);
    if (!point) continue;
    const Eigen::Vector3d ray = point->homogeneous().normalized();
    const double below = ray.dot(down);
    if (!(below < kLowest && below > kHighest)) continue;
    // Direction in the image in which the vertical runs at this place.
    const Eigen::Vector2d vertical = project(camera.intrinsics, ray + kStep * down) - pixel;
    sectors[i] = sector_of(keypoint.angle_deg * kDegree - std::atan2(vertical.y(), vertical.x()));
  }
  return sectors;
}

MutualNeighbours nearest_alike(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                               std::span<const std::int8_t> sectors_a, std::span<const std::int8_t> sectors_b,
                               std::size_t k) {
  MutualNeighbours all{no_neighbours(a.size(), k), no_neighbours(b.size(), k)};
  for (std::int8_t sector = kAnySector; sector < kUprightSectors; ++sector) {
    std::vector<std::int32_t> rows_a, rows_b;  // ascending, because rows decide between equal distances
    for (std::size_t i = 0; i < a.size(); ++i)
      if (sectors_a[i] == sector) rows_a.push_back(static_cast<std::int32_t>(i));
    for (std::size_t j = 0; j < b.size(); ++j)
      if (stand_alike(sector, sectors_b[j])) rows_b.push_back(static_cast<std::int32_t>(j));
    if (rows_a.empty() || rows_b.empty()) continue;
    const MutualNeighbours some = nearest_neighbours(picked(a, rows_a), picked(b, rows_b), k);
    const auto add = [&](const Neighbours& from, const std::vector<std::int32_t>& rows,
                         const std::vector<std::int32_t>& others, Neighbours& to) {
      for (std::size_t i = 0; i < rows.size(); ++i)
        for (std::size_t n = i * k; n < (i + 1) * k && from.row[n] >= 0; ++n)
          insert_neighbour(to, static_cast<std::size_t>(rows[i]), from.distance[n],
                           others[static_cast<std::size_t>(from.row[n])]);
    };
    add(some.of_a, rows_a, rows_b, all.of_a);
    add(some.of_b, rows_b, rows_a, all.of_b);
  }
  return all;
}

Standing compare_standing(std::span<const std::pair<std::int32_t, std::int32_t>> matches,
                          std::span<const std::int8_t> sectors_a, std::span<const std::int8_t> sectors_b) {
  constexpr double kLog10Chance = -3;
  std::array<std::int64_t, kUprightSectors> turned{};
  std::int64_t count = 0;
  for (const auto& [a, b] : matches) {
    const std::int8_t of_a = sectors_a[static_cast<std::size_t>(a)], of_b = sectors_b[static_cast<std::size_t>(b)];
    if (of_a == kAnySector || of_b == kAnySector) continue;
    ++turned[static_cast<std::size_t>(turn_between(of_a, of_b))];
    ++count;
  }
  // Of two turns, each explains the matches within one sector of it. Matches that only one of them explains fall to
  // either with equal probability by chance.
  const auto near = [](int turn, int other) {
    const int apart = turn_between(static_cast<std::int8_t>(turn), static_cast<std::int8_t>(other));
    return apart <= 1 || apart == kUprightSectors - 1;
  };
  for (int turn = 1; turn < kUprightSectors; ++turn) {
    std::int64_t here = 0, without_turn = 0;
    for (int t = 0; t < kUprightSectors; ++t) {
      if (near(turn, t) && !near(0, t)) here += turned[static_cast<std::size_t>(t)];
      if (near(0, t) && !near(turn, t)) without_turn += turned[static_cast<std::size_t>(t)];
    }
    if (std::log10(kUprightSectors - 1) + log10_binomial_tail(here + without_turn, here, 0.5) < kLog10Chance)
      return Standing::kTurned;
  }
  const std::int64_t alike = turned[0] + turned[1] + turned[kUprightSectors - 1];
  return log10_binomial_tail(count, alike, 3.0 / kUprightSectors) < kLog10Chance ? Standing::kAlike
                                                                                 : Standing::kUnknown;
}

std::vector<std::uint8_t> upright_pairs(std::span<const StandingPair> pairs) {
  // Pairs that say nothing themselves are decided by the other pairs of their images.
  std::map<ImageIndex, int> belief;  // number of other images it agrees with, less those it is turned against
  for (const StandingPair& pair : pairs) {
    const int said = pair.standing == Standing::kAlike ? 1 : pair.standing == Standing::kTurned ? -1 : 0;
    belief[pair.a] += said;
    belief[pair.b] += said;
  }
  std::vector<std::uint8_t> upright;
  for (const StandingPair& pair : pairs)
    upright.push_back(pair.standing == Standing::kAlike ||
                      (pair.standing == Standing::kUnknown && belief[pair.a] > 0 && belief[pair.b] > 0));
  return upright;
}

}  // namespace megablock
