// Gives the kernels vectors of doubles, for code that treats several observations or points at once. Each element of a
// vector (a "lane") holds the same quantity of another observation.
//
// The kernels are compiled several times, once for each kind of processor. A kernel's source defines
// MEGABLOCK_LANE_WIDTH (2, 4 or 8 doubles) and then includes this file; no other file may include it. All names are in
// an unnamed namespace, because the same name stands for different instructions in each of the compiled files.
//
// All widths give the same bits: every lane performs the same operations in the same order, and the compiler may not
// contract a multiplication and an addition into one instruction (see cmake/rooms.cmake).
//
// The loops over lanes have a fixed length and must be unrolled; otherwise the compiler keeps the arrays they index in
// memory instead of registers. Hence the many pragmas.
//
// Internal to megablock: it is not installed.
#pragma once

#include <cstdint>
#include <utility>

namespace megablock {
namespace {

constexpr int kWidth = MEGABLOCK_LANE_WIDTH;
typedef double Lanes __attribute__((vector_size(8 * kWidth)));
typedef long long LaneMask __attribute__((vector_size(8 * kWidth)));

// load and store accept addresses of any alignment.
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

// One step of a transposition by butterflies: exchanges the odd groups of `kStep` lanes of a with the even groups of b.
template <int kStep, int... kLane>
[[gnu::always_inline]] inline void exchange(Lanes& a, Lanes& b, std::integer_sequence<int, kLane...>) {
  const LaneMask first{((kLane & kStep) == 0 ? kLane : kWidth + kLane - kStep)...};
  const LaneMask second{((kLane & kStep) == 0 ? kLane + kStep : kWidth + kLane)...};
  const Lanes left = __builtin_shuffle(a, b, first), right = __builtin_shuffle(a, b, second);
  a = left;
  b = right;
}
// Transposes a square block of kWidth vectors in log2(kWidth) such steps.
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

// Reads kWidth records into lanes: afterwards lane i of values[v] holds value v of record i. record(i) returns the
// address of the first of kCount adjacent doubles of record i; kCount must be a multiple of kWidth. Blocks of kWidth
// values are loaded from every record and transposed in registers.
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
