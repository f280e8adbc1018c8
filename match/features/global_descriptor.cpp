// Makes a bag of words whose vocabulary needs no training. Seven fixed hyperplanes cut the space of descriptors into
// 128 cells (M. Charikar, "Similarity estimation techniques from rounding algorithms", STOC 2002: random hyperplane
// hashing). The numbers of descriptors in the cells, square-rooted and normalised, are the vector of the image. The
// normal of a hyperplane has as many elements +1 as -1; typical descriptors, which all have the same norm and no
// negative element, then fall on both sides of it.
#include "match/features/global_descriptor.h"

#include <cmath>
#include <cstdint>
#include <random>
#include <utility>

namespace megablock {

namespace {

constexpr std::size_t kPlanes = 7, kDimension = 128;
using Planes = std::array<std::array<int, kDimension>, kPlanes>;

// The hyperplanes are the same in every run and on every machine: the generator is specified by the standard, the
// shuffle is written out.
Planes make_planes() {
  Planes planes;
  std::mt19937 generator(7);
  for (auto& plane : planes) {
    for (std::size_t i = 0; i < kDimension; ++i) plane[i] = i % 2 == 0 ? 1 : -1;
    for (std::size_t i = kDimension - 1; i > 0; --i) std::swap(plane[i], plane[generator() % (i + 1)]);
  }
  return planes;
}

}  // namespace

std::array<float, 128> global_descriptor(const std::vector<SiftDescriptor>& descriptors) {
  static const Planes planes = make_planes();
  std::array<std::int64_t, kDimension> counts{};
  for (const SiftDescriptor& descriptor : descriptors) {
    std::size_t cell = 0;
    for (const auto& plane : planes) {
      // The signs of the seven scalar products are the seven bits of the cell's number.
      int side = 0;
      for (std::size_t i = 0; i < kDimension; ++i) side += plane[i] * descriptor[i];
      cell = 2 * cell + (side > 0 ? 1 : 0);
    }
    ++counts[cell];
  }
  std::array<float, 128> result{};
  if (descriptors.empty()) return result;
  for (std::size_t i = 0; i < result.size(); ++i) {
    // Square roots of shares have the norm one and damp cells that many descriptors share (Hellinger distance).
    result[i] = static_cast<float>(std::sqrt(static_cast<double>(counts[i]) / static_cast<double>(descriptors.size())));
  }
  return result;
}

}  // namespace megablock
