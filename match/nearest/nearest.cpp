#include "match/nearest/nearest.h"

#include <algorithm>
#include <numeric>

#include "io/base/error.h"
#include "match/nearest/nearest_kernel.h"

namespace megablock {

namespace nearest_kernel {

// The reference for the other kernels. Rows come in blocks, so that a panel of columns is read from the cache for all
// of them.
void run_portable(const Problem& p) {
  for (std::size_t block = 0; block < p.rows; block += kRowBlock) {
    const std::size_t end = std::min(block + kRowBlock, p.rows);
    for (std::size_t panel = 0; panel < p.columns; panel += kColumnTile) {
      for (std::size_t row = block; row < end; ++row) {
        std::int32_t sum[kColumnTile] = {};
        const std::int16_t* a = p.a16 + row * kDimension;
        const std::int16_t* b = p.b16 + panel * kDimension;
        for (std::size_t d = 0; d < kDimension; d += 2, b += 2 * kColumnTile) {
          for (std::size_t c = 0; c < kColumnTile; ++c) sum[c] += a[d] * b[2 * c] + a[d + 1] * b[2 * c + 1];
        }
        for (std::size_t c = 0; c < kColumnTile; ++c) {
          insert_both(p, row, panel + c, p.norm_a[row] + p.norm_b[panel + c] - 2 * sum[c]);
        }
      }
    }
  }
}

}  // namespace nearest_kernel

namespace {

using namespace nearest_kernel;

std::size_t round_up(std::size_t n, std::size_t tile) { return (n + tile - 1) / tile * tile; }

std::vector<std::int32_t> squared_norms(const std::vector<SiftDescriptor>& descriptors, std::size_t padded) {
  std::vector<std::int32_t> norms(padded, Neighbours::kFar);
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::int32_t sum = 0;
    for (const std::int32_t v : descriptors[i]) sum += v * v;
    norms[i] = sum;
  }
  return norms;
}

// Rows of elements less `shift`, modulo 256 for bytes, padded with descriptors of zeros (less `shift`).
template <typename Value>
std::vector<Value> pack_rows(const std::vector<SiftDescriptor>& descriptors, std::size_t padded, int shift = 0) {
  std::vector<Value> packed(padded * kDimension, static_cast<Value>(-shift));
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::transform(descriptors[i].begin(), descriptors[i].end(),
                   packed.begin() + static_cast<std::ptrdiff_t>(i * kDimension),
                   [shift](int value) { return static_cast<Value>(value - shift); });
  }
  return packed;
}

// Panels of kColumnTile descriptors. Within a panel, four bytes of elements of each descriptor follow one another,
// which is what the kernels multiply at a time.
template <typename Value>
std::vector<Value> pack_panels(const std::vector<SiftDescriptor>& descriptors, std::size_t padded) {
  constexpr std::size_t kTogether = 4 / sizeof(Value);
  std::vector<Value> packed(padded * kDimension, 0);
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    Value* panel = packed.data() + i / kColumnTile * kColumnTile * kDimension + kTogether * (i % kColumnTile);
    for (std::size_t d = 0; d < kDimension; ++d) {
      panel[d / kTogether * kTogether * kColumnTile + d % kTogether] = descriptors[i][d];
    }
  }
  return packed;
}

// Largest values of a set, which decide whether the kernel for short descriptors may be used.
struct Size {
  std::int64_t largest_norm = 0;  // squared
  int largest_byte = 0;
};

Size size_of(const std::vector<SiftDescriptor>& descriptors, const std::vector<std::int32_t>& norms) {
  Size size;
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    size.largest_norm = std::max<std::int64_t>(size.largest_norm, norms[i]);
    size.largest_byte =
        std::max<int>(size.largest_byte, *std::max_element(descriptors[i].begin(), descriptors[i].end()));
  }
  return size;
}

bool are_short(const Size& a, const Size& b) {
  constexpr std::int64_t kLargestSum = 32767;
  return a.largest_byte <= 127 && b.largest_byte <= 127 && a.largest_norm * b.largest_norm <= kLargestSum * kLargestSum;
}

// Squared norms less 256 sum(b), for run_avx512: see nearest_kernel.h.
std::vector<std::int32_t> shifted_norms(const std::vector<SiftDescriptor>& descriptors,
                                        std::vector<std::int32_t> norms) {
  for (std::size_t i = 0; i < descriptors.size(); ++i)
    norms[i] -= 256 * std::accumulate(descriptors[i].begin(), descriptors[i].end(), 0);
  return norms;
}

// Reorders [k][padded] to [count][k].
std::vector<std::int32_t> transpose(const std::vector<std::int32_t>& lists, std::size_t k, std::size_t padded,
                                    std::size_t count) {
  std::vector<std::int32_t> result(count * k);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < k; ++j) result[i * k + j] = lists[j * padded + i];
  }
  return result;
}

}  // namespace

NearestKernel fastest_nearest_kernel() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vnni"))
    return NearestKernel::kAvx512;
  return __builtin_cpu_supports("avx2") ? NearestKernel::kAvx2 : NearestKernel::kPortable;
}

MutualNeighbours nearest_neighbours(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                                    std::size_t k, NearestKernel wanted) {
  if (k < 1 || k > 8) throw InputError("nearest neighbours: k must be 1 to 8");
  const NearestKernel kernel = std::min(wanted, fastest_nearest_kernel());
  // Both sets are padded to whole tiles. Padding has the norm kFar, so it is never nearer than a real descriptor.
  const std::size_t rows = round_up(a.size(), kRowMultiple), columns = round_up(b.size(), kColumnTile);
  const std::vector<std::int32_t> norm_a = squared_norms(a, rows);
  std::vector<std::int32_t> norm_b = squared_norms(b, columns);
  std::vector<std::int32_t> row_distance(rows * k, Neighbours::kFar), row_index(rows * k, -1);
  std::vector<std::int32_t> column_distance(columns * k, Neighbours::kFar), column_index(columns * k, -1);
  // The 16-bit sums of the short kernel are exact only for short descriptors, as RootSIFT gives them.
  const bool short_ones = kernel == NearestKernel::kAvx2 && are_short(size_of(a, norm_a), size_of(b, norm_b));
  if (kernel == NearestKernel::kAvx512) norm_b = shifted_norms(b, std::move(norm_b));
  Problem problem{rows,
                  columns,
                  nullptr,
                  nullptr,
                  nullptr,
                  nullptr,
                  norm_a.data(),
                  norm_b.data(),
                  k,
                  row_distance.data(),
                  row_index.data(),
                  column_distance.data(),
                  column_index.data()};
  if (short_ones || kernel == NearestKernel::kAvx512) {
    const auto packed_a = pack_rows<std::uint8_t>(a, rows, short_ones ? 0 : 128),
               packed_b = pack_panels<std::uint8_t>(b, columns);
    problem.a8 = packed_a.data();
    problem.b8 = packed_b.data();
    short_ones ? run_avx2_short(problem) : run_avx512(problem);
  } else {
    const auto packed_a = pack_rows<std::int16_t>(a, rows), packed_b = pack_panels<std::int16_t>(b, columns);
    problem.a16 = packed_a.data();
    problem.b16 = packed_b.data();
    kernel == NearestKernel::kAvx2 ? run_avx2(problem) : run_portable(problem);
  }
  MutualNeighbours result;
  row_distance.resize(a.size() * k);
  row_index.resize(a.size() * k);
  result.of_a = {k, std::move(row_distance), std::move(row_index)};
  result.of_b = {k, transpose(column_distance, k, columns, b.size()), transpose(column_index, k, columns, b.size())};
  return result;
}

}  // namespace megablock
