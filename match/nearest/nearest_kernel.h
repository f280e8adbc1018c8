// Declares the inner loops of nearest_neighbours. Internal to match/. They work on raw pointers, so that each kernel
// can be compiled for its own processor.
//
// |a - b|^2 = |a|^2 + |b|^2 - 2 a.b, so the distances are a matrix product of bytes. It is computed in tiles of a few
// rows and 16 or 32 columns. A tile stays in registers, and its distances go straight into the lists of nearest
// neighbours of its rows and columns; the matrix is never stored.
//
// There are three kernels, all exact.
//
// * Any bytes: widened to 16 bits; the products are summed in 32 bits.
// * Short descriptors (|a| |b| < 2^15, no byte above 127): the products are summed in 16 bits, which is twice as fast.
//   By the inequality of Cauchy and Schwarz no partial sum exceeds |a| |b|, so none overflows.
// * AVX-512 with VNNI: multiplies unsigned by signed bytes and sums in 32 bits, four times as fast again. It takes
//   a - 128 instead of a. As a.b = (a - 128).b + 128 sum(b), the caller subtracts 256 sum(b) from |b|^2 beforehand.
#pragma once

#include <cstddef>
#include <cstdint>

namespace megablock::nearest_kernel {

// Length of a descriptor, columns of a panel, rows of a block that stays in the cache.
inline constexpr std::size_t kDimension = 128, kColumnTile = 16, kRowBlock = 64;
inline constexpr std::size_t kRowMultiple = 8;  // the kernels take this many rows at a time

struct Problem {
  std::size_t rows, columns;  // multiples of kRowMultiple and kColumnTile; padding has the norm Neighbours::kFar
  // The descriptors as 16-bit or as 8-bit integers. A kernel reads one of the two; the other may be null.
  const std::int16_t *a16, *b16;        // [rows][kDimension]; [columns / kColumnTile][kDimension / 2][kColumnTile][2]
  const std::uint8_t *a8, *b8;          // [rows][kDimension]; [columns / kColumnTile][kDimension / 4][kColumnTile][4]
  const std::int32_t *norm_a, *norm_b;  // squared norms, in the form that the kernel takes
  std::size_t k;
  // Nearest first; all distances start at Neighbours::kFar, all indices at -1.
  std::int32_t *row_distance, *row_index;        // [rows][k]
  std::int32_t *column_distance, *column_index;  // [k][columns]
};

// Inserts into a sorted list whose entries are `stride` apart, behind equal distances. Rows and columns come in
// ascending order, so of equal distances the lower index is first. The function is static, because each kernel needs
// its own, compiled for its processor.
static inline void insert(std::int32_t* distances, std::int32_t* indices, std::size_t stride, std::size_t k,
                          std::int32_t distance, std::int32_t index) {
  std::size_t i = k - 1;
  if (distance >= distances[i * stride]) return;
  for (; i > 0 && distance < distances[(i - 1) * stride]; --i) {
    distances[i * stride] = distances[(i - 1) * stride];
    indices[i * stride] = indices[(i - 1) * stride];
  }
  distances[i * stride] = distance;
  indices[i * stride] = index;
}

// Inserts a distance into the list of its row and into that of its column.
static inline void insert_both(const Problem& p, std::size_t row, std::size_t column, std::int32_t distance) {
  insert(p.row_distance + row * p.k, p.row_index + row * p.k, 1, p.k, distance, static_cast<std::int32_t>(column));
  insert(p.column_distance + column, p.column_index + column, p.columns, p.k, distance, static_cast<std::int32_t>(row));
}

void run_portable(const Problem& problem);    // 16-bit elements; any processor
void run_avx2(const Problem& problem);        // 16-bit elements; needs AVX2
void run_avx2_short(const Problem& problem);  // 8-bit elements of short descriptors; needs AVX2
void run_avx512(const Problem& problem);      // 8-bit elements, those of a less 128; needs AVX-512 VNNI

}  // namespace megablock::nearest_kernel
