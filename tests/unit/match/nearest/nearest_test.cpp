// Nearest neighbours: every kernel against a brute-force search, up to the limits of their integers.
#include "match/nearest/nearest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "io/base/error.h"
#include "match/nearest/nearest_kernel.h"
#include "match/pairs/pair_matching.h"

namespace megablock {
namespace {

// Kernels that this processor cannot run are replaced by the fastest that it can.
constexpr NearestKernel kAvx2 = NearestKernel::kAvx2;
constexpr NearestKernel kKernels[] = {NearestKernel::kPortable, kAvx2, NearestKernel::kAvx512};

std::vector<SiftDescriptor> random_descriptors(std::size_t count, int largest, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::vector<SiftDescriptor> result(count);
  for (auto& d : result) {
    for (auto& v : d) v = static_cast<std::uint8_t>(generator() % static_cast<std::uint64_t>(largest + 1));
  }
  return result;
}

std::int32_t squared_distance(const SiftDescriptor& a, const SiftDescriptor& b) {
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

// All distances, sorted.
Neighbours brute_force(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b, std::size_t k) {
  Neighbours result;
  result.k = k;
  for (const auto& row : a) {
    std::vector<std::pair<std::int32_t, std::int32_t>> all;
    for (std::size_t j = 0; j < b.size(); ++j)
      all.emplace_back(squared_distance(row, b[j]), static_cast<std::int32_t>(j));
    std::sort(all.begin(), all.end());
    all.resize(std::max(all.size(), k), {Neighbours::kFar, -1});
    for (std::size_t i = 0; i < k; ++i) {
      result.distance.push_back(all[i].first);
      result.row.push_back(all[i].second);
    }
  }
  return result;
}

void expect_equal(const Neighbours& found, const Neighbours& expected) {
  EXPECT_EQ(found.k, expected.k);
  EXPECT_EQ(found.distance, expected.distance);
  EXPECT_EQ(found.row, expected.row);
}

struct Case {
  std::size_t rows_a, rows_b;
  int largest;  // 1: many ties; 20: the kernel for short descriptors; 255: the largest products
};

class Nearest : public testing::TestWithParam<Case> {};

TEST_P(Nearest, EqualsBruteForceBothWays) {
  const auto a = random_descriptors(GetParam().rows_a, GetParam().largest, 1);
  const auto b = random_descriptors(GetParam().rows_b, GetParam().largest, 2);
  for (std::size_t k = 1; k <= 4; ++k) {
    const Neighbours of_a = brute_force(a, b, k), of_b = brute_force(b, a, k);
    for (const NearestKernel kernel : kKernels) {
      const MutualNeighbours found = nearest_neighbours(a, b, k, kernel);
      expect_equal(found.of_a, of_a);
      expect_equal(found.of_b, of_b);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, Nearest,
                         testing::Values(Case{0, 0, 255}, Case{0, 5, 255}, Case{1, 1, 255}, Case{3, 2, 255},
                                         Case{4, 16, 255}, Case{67, 33, 255}, Case{200, 301, 1}, Case{130, 257, 90},
                                         Case{67, 33, 20}, Case{131, 258, 20}, Case{200, 320, 255}, Case{72, 48, 20}));

TEST(NearestExtremes, FullBytesAreExact) {
  std::vector<SiftDescriptor> bright(5), dark(5);
  for (auto& d : bright) d.fill(255);
  for (auto& d : dark) d.fill(0);
  for (const NearestKernel kernel : kKernels) {
    const auto apart = nearest_neighbours(bright, dark, 2, kernel);
    EXPECT_EQ(apart.of_a.distance, std::vector<std::int32_t>(10, 128 * 255 * 255));
    EXPECT_EQ(nearest_neighbours(dark, bright, 2, kernel).of_a.distance, apart.of_b.distance);
    EXPECT_EQ(nearest_neighbours(bright, bright, 1, kernel).of_a.distance, std::vector<std::int32_t>(5, 0));
  }
}

TEST(NearestExtremes, SumsAtTheLimitOfSixteenBits) {
  // One pair of elements carries nearly the whole norm: 127^2 + 127^2 = 32258 < 2^15; the others fill up the rest.
  SiftDescriptor peak{};
  peak[6] = peak[7] = 127;
  for (std::size_t i = 10; i < 14; ++i) peak[i] = 11;
  SiftDescriptor flat;
  flat.fill(15);
  for (const auto& d : {peak, flat}) {
    const std::vector<SiftDescriptor> set(20, d), zero(20, SiftDescriptor{});
    EXPECT_EQ(nearest_neighbours(set, set, 2, kAvx2).of_a.distance, std::vector<std::int32_t>(40, 0));
    EXPECT_EQ(nearest_neighbours(set, zero, 2, kAvx2).of_b.distance,
              std::vector<std::int32_t>(40, squared_distance(d, zero[0])));
  }
  const std::vector<SiftDescriptor> peaks(3, peak), flats(3, flat);
  EXPECT_EQ(nearest_neighbours(peaks, flats, 1, kAvx2).of_a.distance,
            std::vector<std::int32_t>(3, squared_distance(peak, flat)));
  std::vector<SiftDescriptor> beyond(3, peak);  // one step above the limit: the other kernel
  for (auto& d : beyond) d[20] = 60;
  EXPECT_EQ(nearest_neighbours(beyond, beyond, 1, kAvx2).of_a.distance, std::vector<std::int32_t>(3, 0));
}

// The rule of the header, written out.
std::vector<std::pair<std::int32_t, std::int32_t>> expected_matches(const std::vector<SiftDescriptor>& a,
                                                                    const std::vector<SiftDescriptor>& b,
                                                                    const MatchOptions& options) {
  const auto k = static_cast<std::size_t>(options.k_best);
  const Neighbours of_a = brute_force(a, b, k + 1), of_b = brute_force(b, a, k + 1);
  const auto accepts = [&](const Neighbours& n, std::size_t row, std::size_t other) {
    for (std::size_t i = 0; i < k; ++i) {
      if (n.row[row * (k + 1) + i] != static_cast<std::int32_t>(other)) continue;
      return std::sqrt(n.distance[row * (k + 1) + i]) < options.ratio * std::sqrt(n.distance[row * (k + 1) + k]);
    }
    return false;
  };
  std::vector<std::pair<std::int32_t, std::int32_t>> matches;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      if (accepts(of_a, i, j) && accepts(of_b, j, i)) {
        matches.emplace_back(static_cast<std::int32_t>(i), static_cast<std::int32_t>(j));
      }
    }
  }
  return matches;
}

TEST(MatchDescriptors, EqualsTheRuleWrittenOut) {
  auto a = random_descriptors(150, 120, 3);
  auto b = random_descriptors(170, 120, 4);
  std::mt19937_64 generator(5);
  for (std::size_t i = 0; i < 100; ++i) {  // noisy copies; every third one is repeated, as on a facade
    b[i] = a[i];
    for (auto& v : b[i]) v = static_cast<std::uint8_t>(v + generator() % 9);
    if (i % 3 == 0) b[100 + i / 3] = b[i];
  }
  for (const int k : {1, 2, 3}) {
    MatchOptions options;
    options.k_best = k;
    const auto found = match_descriptors(a, b, options);
    EXPECT_EQ(found, expected_matches(a, b, options)) << k;
    EXPECT_GE(found.size(), 60u) << k;
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  }
}

TEST(MatchDescriptors, MoreNeighboursRecoverRepeatedElements) {
  const auto a = random_descriptors(50, 120, 6);
  std::vector<SiftDescriptor> b = a;
  b.insert(b.end(), a.begin(), a.end());  // every element twice
  MatchOptions options;
  EXPECT_TRUE(match_descriptors(a, b, options).empty());
  options.k_best = 3;
  EXPECT_EQ(match_descriptors(a, b, options).size(), 100u);
}

TEST(MatchDescriptors, FewDescriptors) {
  const auto a = random_descriptors(1, 120, 7);
  EXPECT_TRUE(match_descriptors({}, a, {}).empty());
  EXPECT_EQ(match_descriptors(a, a, {}).size(), 1u);
  MatchOptions options;
  options.k_best = 0;
  EXPECT_THROW(match_descriptors(a, a, options), InputError);
}

}  // namespace
}  // namespace megablock
