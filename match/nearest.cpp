#include "match/nearest.h"

#include <algorithm>

#include "io/error.h"
#include "match/nearest_kernel.h"

namespace megablock {

namespace nearest_kernel {

void run_portable(const Problem& p) {
  for (std::size_t block = 0; block < p.rows; block += kRowBlock) {
    const std::size_t end = std::min(block + kRowBlock, p.rows);
    for (std::size_t panel = 0; panel < p.columns; panel += kColumnTile) {
      for (std::size_t row = block; row < end; ++row) {
        std::int32_t sum[kColumnTile] = {};
        const std::int16_t* a = p.a + row * kDimension;
        const std::int16_t* b = p.b + panel * kDimension;
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

std::vector<std::int16_t> pack_rows(const std::vector<SiftDescriptor>& descriptors, std::size_t padded) {
  std::vector<std::int16_t> packed(padded * kDimension, 0);
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::copy(descriptors[i].begin(), descriptors[i].end(),
              packed.begin() + static_cast<std::ptrdiff_t>(i * kDimension));
  }
  return packed;
}

std::vector<std::int16_t> pack_panels(const std::vector<SiftDescriptor>& descriptors, std::size_t padded) {
  std::vector<std::int16_t> packed(padded * kDimension, 0);
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::int16_t* panel = packed.data() + i / kColumnTile * kColumnTile * kDimension + 2 * (i % kColumnTile);
    for (std::size_t d = 0; d < kDimension; d += 2) {
      panel[d * kColumnTile] = descriptors[i][d];
      panel[d * kColumnTile + 1] = descriptors[i][d + 1];
    }
  }
  return packed;
}

// [k][padded] to [count][k].
std::vector<std::int32_t> transpose(const std::vector<std::int32_t>& lists, std::size_t k, std::size_t padded,
                                    std::size_t count) {
  std::vector<std::int32_t> result(count * k);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < k; ++j) result[i * k + j] = lists[j * padded + i];
  }
  return result;
}

}  // namespace

MutualNeighbours nearest_neighbours(const std::vector<SiftDescriptor>& a, const std::vector<SiftDescriptor>& b,
                                    std::size_t k, bool portable) {
  if (k < 1 || k > 8) throw InputError("nearest neighbours: k must be 1 to 8");
  const std::size_t rows = round_up(a.size(), kRowTile), columns = round_up(b.size(), kColumnTile);
  const std::vector<std::int16_t> packed_a = pack_rows(a, rows), packed_b = pack_panels(b, columns);
  const std::vector<std::int32_t> norm_a = squared_norms(a, rows), norm_b = squared_norms(b, columns);
  std::vector<std::int32_t> row_distance(rows * k, Neighbours::kFar), row_index(rows * k, -1);
  std::vector<std::int32_t> column_distance(columns * k, Neighbours::kFar), column_index(columns * k, -1);
  const Problem problem{rows,
                        columns,
                        packed_a.data(),
                        packed_b.data(),
                        norm_a.data(),
                        norm_b.data(),
                        k,
                        row_distance.data(),
                        row_index.data(),
                        column_distance.data(),
                        column_index.data()};
  if (!portable && __builtin_cpu_supports("avx2")) {
    run_avx2(problem);
  } else {
    run_portable(problem);
  }
  MutualNeighbours result;
  row_distance.resize(a.size() * k);
  row_index.resize(a.size() * k);
  result.of_a = {k, std::move(row_distance), std::move(row_index)};
  result.of_b = {k, transpose(column_distance, k, columns, b.size()), transpose(column_index, k, columns, b.size())};
  return result;
}

}  // namespace megablock
