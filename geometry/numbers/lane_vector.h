// Internal to the kernels. Vectors of doubles, one value of several observations or points each ("lanes"), for kernels
// that are compiled once per kind of processor. Included by those kernels only, behind a definition of
// MEGABLOCK_LANE_WIDTH (2, 4 or 8 doubles).
//
// Everything is in an unnamed namespace: the same names stand for different instructions in each of these files. No
// multiplication and addition are contracted (cmake/rooms.cmake), so that all widths give the same bits.
//
// Loops of a fixed length are to be unrolled, or what they index stays in memory: hence the many pragmas.
#pragma once

#include <cstdint>
#include <utility>

namespace megablock {
namespace {

constexpr int kWidth = MEGABLOCK_LANE_WIDTH;
typedef double Lanes __attribute__((vector_size(8 * kWidth)));
typedef long long LaneMask __attribute__((vector_size(8 * kWidth)));

[[gnu::always_inline]] inline Lanes load(const double* p) {
  Lanes v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}
[[gnu::always_inline]] inline void store(double* p, const Lanes& v) { __builtin_memcpy(p, &v, sizeof v); }
[[gnu::always_inline]] inline Lanes square_root(const Lanes& v) {
  Lanes root;
#pragma GCC unroll 64
  for (int i = 0; i < kWidth; ++i) root[i] = __builtin_sqrt(v[i]);
  return root;
}

// Exchanges the odd groups of `kStep` lanes of a with the even ones of b.
template <int kStep, int... kLane>
[[gnu::always_inline]] inline void exchange(Lanes& a, Lanes& b, std::integer_sequence<int, kLane...>) {
  const LaneMask first{((kLane & kStep) == 0 ? kLane : kWidth + kLane - kStep)...};
  const LaneMask second{((kLane & kStep) == 0 ? kLane + kStep : kWidth + kLane)...};
  const Lanes left = __builtin_shuffle(a, b, first), right = __builtin_shuffle(a, b, second);
  a = left;
  b = right;
}
template <int kStep>
[[gnu::always_inline]] inline void exchange_all(Lanes (&rows)[kWidth]) {
  if constexpr (kStep < kWidth) {
#pragma GCC unroll 64
    for (int i = 0; i < kWidth; ++i)
      if ((i & kStep) == 0) exchange<kStep>(rows[i], rows[i + kStep], std::make_integer_sequence<int, kWidth>());
    exchange_all<2 * kStep>(rows);
  }
}
[[gnu::always_inline]] inline void transpose(Lanes (&rows)[kWidth]) { exchange_all<1>(rows); }

// values[v]: of kWidth records, whose values lie side by side; `kCount` is a multiple of kWidth.
template <int kCount, typename Record>
[[gnu::always_inline]] inline void read_records(Record record, Lanes (&values)[kCount]) {
#pragma GCC unroll 64
  for (int block = 0; block < kCount; block += kWidth) {
    Lanes rows[kWidth];
#pragma GCC unroll 64
    for (int lane = 0; lane < kWidth; ++lane) rows[lane] = load(record(lane) + block);
    transpose(rows);
#pragma GCC unroll 64
    for (int k = 0; k < kWidth; ++k) values[block + k] = rows[k];
  }
}

}  // namespace
}  // namespace megablock
