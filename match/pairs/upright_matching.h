// Matching of two images that know where down is: what stands upright in one does so in the other.
//
// A feature's direction is counted from that of the vertical at its place, in sectors of 30 degrees, and features are
// compared with those of the same sector and the two beside it: a quarter of all comparisons (gravity-aligned features:
// D. Kurz and S. Benhimane, "Inertial sensor-aligned visual feature descriptors", CVPR 2011). Of verified matches in
// streets 99 % differ by less than 20 degrees. The direction says nothing where one looks down on the ground, which
// turns with the heading, nor next to the zenith: features seen more than 30 degrees below the horizon or 60 above it
// are compared with all.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "io/block/block.h"
#include "io/block/features.h"
#include "match/nearest/nearest.h"

namespace megablock {

inline constexpr int kUprightSectors = 12;
inline constexpr std::int8_t kAnySector = -1;

// The sector of a direction, in radians, any number of turns.
std::int8_t sector_of(double angle_rad);

// [features]: 0 to kUprightSectors - 1, or kAnySector. `down`: unit, camera axes.
std::vector<std::int8_t> upright_sectors(const ImageFeatures& image, const Camera& camera, const Eigen::Vector3d& down);

// As nearest_neighbours of all, those left out that differ by more than one sector.
MutualNeighbours nearest_alike(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                               std::span<const std::int8_t> sectors_a, std::span<const std::int8_t> sectors_b,
                               std::size_t k);

// How features that match, found regardless of sectors, stand in two images.
enum class Standing : std::int8_t {
  kUnknown,  // too few to tell
  kAlike,
  kTurned,  // most of them by another turn than none: a vertical is wrong
};
// Of pairs without any right match, whose turns are evenly spread, no more than one in a thousand is taken for alike,
// and one for turned.
Standing compare_standing(std::span<const std::pair<std::int32_t, std::int32_t>> matches,
                          std::span<const std::int8_t> sectors_a, std::span<const std::int8_t> sectors_b);

struct StandingPair {
  ImageIndex a, b;
  Standing standing = Standing::kUnknown;
};
// 1 for the pairs in which only features that stand alike need to be compared: where they are seen to stand so, and,
// where nothing is seen, of images that stand alike with more others than they are turned against. A wrong vertical
// costs a pair its matches, so that it takes evidence to believe one.
std::vector<std::uint8_t> upright_pairs(std::span<const StandingPair> pairs);

}  // namespace megablock
