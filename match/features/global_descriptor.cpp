// A bag of words whose vocabulary needs no training: seven fixed hyperplanes through the descriptor space cut it into
// 128 cells (random hyperplane hashing, Charikar 2002); the counts of the cells, square-rooted and normalised, are the
// image's vector. A hyperplane's normal has entries +1 and -1, as many of each, so that typical descriptors (all of
// the same norm, none negative) fall on both sides of it.
#include "match/features/global_descriptor.h"

#include <cmath>
#include <cstdint>
#include <random>
#include <utility>

namespace megablock {

namespace {

constexpr std::size_t kPlanes = 7, kDimension = 128;
using Planes = std::array<std::array<int, kDimension>, kPlanes>;

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
      int side = 0;
      for (std::size_t i = 0; i < kDimension; ++i) side += plane[i] * descriptor[i];
      cell = 2 * cell + (side > 0 ? 1 : 0);
    }
    ++counts[cell];
  }
  std::array<float, 128> result{};
  if (descriptors.empty()) return result;
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i] = static_cast<float>(std::sqrt(static_cast<double>(counts[i]) / static_cast<double>(descriptors.size())));
  }
  return result;
}

}  // namespace megablock
