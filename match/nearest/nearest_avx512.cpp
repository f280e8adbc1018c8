// This must come before the intrinsics, which are declared for the instruction sets named here.
#pragma GCC target("avx512bw,avx512vnni")

#include <immintrin.h>

#include <algorithm>

#include "match/nearest/nearest_kernel.h"

namespace megablock::nearest_kernel {

namespace {

constexpr std::size_t kRows = 8, kPanels = 2;  // rows and panels of columns of a tile in registers

__m512i load(const void* p) { return _mm512_loadu_si512(p); }

// Loads four bytes of a row into every lane.
__m512i broadcast_four_bytes(const void* p) {
  std::int32_t bytes;
  __builtin_memcpy(&bytes, p, sizeof bytes);
  return _mm512_set1_epi32(bytes);
}

// sum += four products each of unsigned bytes of b and signed bytes of a. Written as assembly, because GCC 12 copies
// every sum twice around the intrinsic, which costs half of the speed.
void add_products(__m512i& sum, __m512i of_b, __m512i of_a) {
  asm("vpdpbusd %2, %1, %0" : "+v"(sum) : "v"(of_b), "v"(of_a));
}

// Dot products of a tile.
template <std::size_t panels>
[[gnu::always_inline]] inline void multiply(const Problem& p, std::size_t row, std::size_t column,
                                            __m512i (&sum)[kRows][panels]) {
#pragma GCC unroll 8
  for (std::size_t r = 0; r < kRows; ++r)
#pragma GCC unroll 2
    for (std::size_t q = 0; q < panels; ++q) sum[r][q] = _mm512_setzero_si512();
  const std::uint8_t* a = p.a8 + row * kDimension;
  const std::uint8_t* b = p.b8 + column * kDimension;
  for (std::size_t d = 0; d < kDimension; d += 4, b += 4 * kColumnTile) {
    __m512i of_b[panels];
#pragma GCC unroll 2
    for (std::size_t q = 0; q < panels; ++q) of_b[q] = load(b + q * kColumnTile * kDimension);
#pragma GCC unroll 8
    for (std::size_t r = 0; r < kRows; ++r) {
      const __m512i four = broadcast_four_bytes(a + r * kDimension + d);
#pragma GCC unroll 2
      for (std::size_t q = 0; q < panels; ++q) add_products(sum[r][q], of_b[q], four);
    }
  }
}

// Computes the distances of a tile, and inserts those that are nearer than the last entry of a list of a row or a
// column.
template <std::size_t panels>
[[gnu::always_inline]] inline void keep_nearest(const Problem& p, std::size_t row, std::size_t column,
                                                const __m512i (&sum)[kRows][panels]) {
#pragma GCC unroll 2
  for (std::size_t q = 0; q < panels; ++q, column += kColumnTile) {
    const __m512i norm_b = load(p.norm_b + column),
                  worst_column = load(p.column_distance + (p.k - 1) * p.columns + column);
    __m512i distance[kRows];
    __mmask16 candidates[kRows];
    unsigned any = 0;
#pragma GCC unroll 8
    for (std::size_t r = 0; r < kRows; ++r) {
      const __m512i norms = _mm512_add_epi32(_mm512_set1_epi32(p.norm_a[row + r]), norm_b);
      distance[r] = _mm512_sub_epi32(norms, _mm512_add_epi32(sum[r][q], sum[r][q]));
      const __m512i worst_row = _mm512_set1_epi32(p.row_distance[(row + r) * p.k + p.k - 1]);
      candidates[r] = static_cast<__mmask16>(_mm512_cmpgt_epi32_mask(worst_row, distance[r]) |
                                             _mm512_cmpgt_epi32_mask(worst_column, distance[r]));
      any |= candidates[r];
    }
    if (any == 0) continue;
    for (std::size_t r = 0; r < kRows; ++r) {
      if (candidates[r] == 0) continue;
      alignas(64) std::int32_t of_row[kColumnTile];
      _mm512_store_si512(of_row, distance[r]);
      for (unsigned rest = candidates[r]; rest != 0; rest &= rest - 1) {
        const auto c = static_cast<std::size_t>(__builtin_ctz(rest));
        insert_both(p, row + r, column + c, of_row[c]);
      }
    }
  }
}

template <std::size_t panels>
void tile(const Problem& p, std::size_t row, std::size_t column) {
  __m512i sum[kRows][panels];
  multiply(p, row, column, sum);
  keep_nearest(p, row, column, sum);
}

}  // namespace

// Columns are treated in pairs of panels; an odd last panel is done alone.
void run_avx512(const Problem& p) {
  static_assert(kRowMultiple % kRows == 0 && kRowBlock % kRows == 0);
  constexpr std::size_t kColumns = kPanels * kColumnTile;
  for (std::size_t block = 0; block < p.rows; block += kRowBlock) {
    const std::size_t end = std::min(block + kRowBlock, p.rows);
    std::size_t column = 0;
    for (; column + kColumns <= p.columns; column += kColumns)
      for (std::size_t row = block; row < end; row += kRows) tile<kPanels>(p, row, column);
    for (; column < p.columns; column += kColumnTile)
      for (std::size_t row = block; row < end; row += kRows) tile<1>(p, row, column);
  }
}

}  // namespace megablock::nearest_kernel
