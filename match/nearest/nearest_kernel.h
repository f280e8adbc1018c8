// The inner loops of nearest_neighbours on raw pointers, so that they can be compiled for another processor.
//
// |a - b|^2 = |a|^2 + |b|^2 - 2 a.b is a matrix product of bytes. It is computed in tiles of some rows and 16 or 32
// columns that stay in registers and go straight into the lists of nearest neighbours of the rows and of the columns:
// the matrix is never stored.
//
// Three exact kernels. Any bytes: widened to 16 bits, products summed in 32 bits. Short descriptors (|a| |b| < 2^15, no
// byte above 127): products summed in 16 bits, twice as fast; by Cauchy-Schwarz no sum over any part of the components
// exceeds |a| |b|, so none overflows on the way. AVX-512 with VNNI multiplies unsigned by signed bytes, summed in 32
// bits, four times as fast again: of a it takes a - 128, and as a.b = (a - 128).b + 128 sum(b), 256 sum(b) is taken off
// |b|^2 beforehand.
#pragma once

#include <cstddef>
#include <cstdint>

namespace megablock::nearest_kernel {

inline constexpr std::size_t kDimension = 128, kColumnTile = 16, kRowBlock = 64;
inline constexpr std::size_t kRowMultiple = 8;  // of the rows that kernels take at a time

struct Problem {
  std::size_t rows, columns;  // multiples of kRowMultiple and kColumnTile; the padding's norm is Neighbours::kFar
  // The descriptors as 16-bit or as 8-bit integers; a kernel reads one kind, the other may be null.
  const std::int16_t *a16, *b16;        // [rows][kDimension]; [columns / kColumnTile][kDimension / 2][kColumnTile][2]
  const std::uint8_t *a8, *b8;          // [rows][kDimension]; [columns / kColumnTile][kDimension / 4][kColumnTile][4]
  const std::int32_t *norm_a, *norm_b;  // squared norms, as the kernel takes them
  std::size_t k;
  // Nearest first; all distances start at Neighbours::kFar, all indices at -1.
  std::int32_t *row_distance, *row_index;        // [rows][k]
  std::int32_t *column_distance, *column_index;  // [k][columns]
};

// Inserts into a sorted list whose entries lie `stride` apart, behind equal distances. Rows and columns are visited
// in ascending order, so ties keep the lower index.
// Static: each kernel has its own, compiled for its processor.
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

static inline void insert_both(const Problem& p, std::size_t row, std::size_t column, std::int32_t distance) {
  insert(p.row_distance + row * p.k, p.row_index + row * p.k, 1, p.k, distance, static_cast<std::int32_t>(column));
  insert(p.column_distance + column, p.column_index + column, p.columns, p.k, distance, static_cast<std::int32_t>(row));
}

void run_portable(const Problem& problem);    // 16-bit
void run_avx2(const Problem& problem);        // 16-bit; needs a processor with AVX2
void run_avx2_short(const Problem& problem);  // 8-bit, short descriptors; needs a processor with AVX2
void run_avx512(const Problem& problem);      // 8-bit, of a less 128; needs a processor with AVX-512 VNNI

}  // namespace megablock::nearest_kernel
