#include <immintrin.h>

#include <algorithm>

#include "match/nearest/nearest_kernel.h"

namespace megablock::nearest_kernel {

namespace {

constexpr std::size_t kRowTile = 4;  // rows of a tile in registers

__m256i load(const void* p) { return _mm256_loadu_si256(static_cast<const __m256i*>(p)); }

// Loads four bytes of a row (two or four of its elements) into every lane.
__m256i broadcast_four_bytes(const void* p) {
  std::int32_t bytes;
  __builtin_memcpy(&bytes, p, sizeof bytes);
  return _mm256_set1_epi32(bytes);
}

using Sums = __m256i[kRowTile][2];  // 32-bit dot products of 4 rows with 16 columns

// Dot products of a tile, from 16-bit elements.
void multiply(const Problem& p, std::size_t row, std::size_t column, Sums& sum) {
  for (auto& s : sum) s[0] = s[1] = _mm256_setzero_si256();
  const std::int16_t* a = p.a16 + row * kDimension;
  const std::int16_t* b = p.b16 + column * kDimension;
  for (std::size_t d = 0; d < kDimension; d += 2, b += 2 * kColumnTile) {
    const __m256i b0 = load(b), b1 = load(b + kColumnTile);
#pragma GCC unroll 4
    for (std::size_t r = 0; r < kRowTile; ++r) {
      const __m256i pair = broadcast_four_bytes(a + r * kDimension + d);
      sum[r][0] = _mm256_add_epi32(sum[r][0], _mm256_madd_epi16(pair, b0));
      sum[r][1] = _mm256_add_epi32(sum[r][1], _mm256_madd_epi16(pair, b1));
    }
  }
}

// Dot products of a tile of short descriptors, from 8-bit elements.
void multiply_short(const Problem& p, std::size_t row, std::size_t column, Sums& sum) {
  for (auto& s : sum) s[0] = s[1] = _mm256_setzero_si256();
  const std::uint8_t* a = p.a8 + row * kDimension;
  const std::uint8_t* b = p.b8 + column * kDimension;
  for (std::size_t d = 0; d < kDimension; d += 4, b += 4 * kColumnTile) {
    const __m256i b0 = load(b), b1 = load(b + 2 * kColumnTile);
#pragma GCC unroll 4
    for (std::size_t r = 0; r < kRowTile; ++r) {
      const __m256i four = broadcast_four_bytes(a + r * kDimension + d);
      sum[r][0] = _mm256_add_epi16(sum[r][0], _mm256_maddubs_epi16(four, b0));
      sum[r][1] = _mm256_add_epi16(sum[r][1], _mm256_maddubs_epi16(four, b1));
    }
  }
  const __m256i ones = _mm256_set1_epi16(1);
  for (auto& s : sum) {
    s[0] = _mm256_madd_epi16(s[0], ones);
    s[1] = _mm256_madd_epi16(s[1], ones);
  }
}

// Computes the distances of a tile, and inserts those that are nearer than the last entry of a list of a row or a
// column.
void keep_nearest(const Problem& p, std::size_t row, std::size_t column, const Sums& sum) {
  alignas(32) std::int32_t distance[kRowTile][kColumnTile];
  const std::int32_t* worst_column = p.column_distance + (p.k - 1) * p.columns + column;
  unsigned candidates[kRowTile], any = 0;
#pragma GCC unroll 4
  for (std::size_t r = 0; r < kRowTile; ++r) {
    const __m256i norm = _mm256_set1_epi32(p.norm_a[row + r]);
    const __m256i worst_row = _mm256_set1_epi32(p.row_distance[(row + r) * p.k + p.k - 1]);
    candidates[r] = 0;
#pragma GCC unroll 2
    for (std::size_t h = 0; h < 2; ++h) {
      const __m256i twice = _mm256_slli_epi32(sum[r][h], 1);
      const __m256i value = _mm256_sub_epi32(_mm256_add_epi32(norm, load(p.norm_b + column + 8 * h)), twice);
      _mm256_store_si256(reinterpret_cast<__m256i*>(distance[r] + 8 * h), value);
      const __m256i nearer =
          _mm256_or_si256(_mm256_cmpgt_epi32(worst_row, value), _mm256_cmpgt_epi32(load(worst_column + 8 * h), value));
      candidates[r] |= static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(nearer))) << (8 * h);
    }
    any |= candidates[r];
  }
  // This is the usual case: once the lists are filled, hardly any distance enters one.
  if (any == 0) return;
  for (std::size_t r = 0; r < kRowTile; ++r) {
    for (unsigned rest = candidates[r]; rest != 0; rest &= rest - 1) {
      const auto c = static_cast<std::size_t>(__builtin_ctz(rest));
      insert_both(p, row + r, column + c, distance[r][c]);
    }
  }
}

// Visits the tiles so that a block of rows stays in the cache while all columns pass.
template <typename Multiply>
void run(const Problem& p, Multiply multiply_tile) {
  Sums sum;
  for (std::size_t block = 0; block < p.rows; block += kRowBlock) {
    const std::size_t end = std::min(block + kRowBlock, p.rows);
    for (std::size_t column = 0; column < p.columns; column += kColumnTile) {
      for (std::size_t row = block; row < end; row += kRowTile) {
        multiply_tile(p, row, column, sum);
        keep_nearest(p, row, column, sum);
      }
    }
  }
}

}  // namespace

void run_avx2(const Problem& p) {
  run(p, [](const Problem& q, std::size_t row, std::size_t column, Sums& sum) { multiply(q, row, column, sum); });
}

void run_avx2_short(const Problem& p) {
  run(p, [](const Problem& q, std::size_t row, std::size_t column, Sums& sum) { multiply_short(q, row, column, sum); });
}

}  // namespace megablock::nearest_kernel
