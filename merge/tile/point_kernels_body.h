// Defines the kernels of point_kernels.h for vectors of any width, so that all processors run one source. Internal to
// merge/tile/: each point_kernels_*.cpp sets the width and includes it. The formulas are in point_equations.h and
// cell_assembler.h.
//
// A kernel works on kWidth lanes at a time. Counts are multiples of eight, the largest width, so that no kernel has a
// loop for a remainder; the lanes behind the last one hold values that do no harm. The elements of a vector are one
// value of several lanes, or several values of one record. Each of them goes through its operations in the order of the
// source, so that all widths give the same bits (geometry/numbers/lane_vector.h).
#pragma once

#if MEGABLOCK_LANE_WIDTH == 8
#include <immintrin.h>
#endif

#include "adjust/lanes/lane_kernels.h"
#include "geometry/numbers/lane_vector.h"
#include "merge/tile/point_kernels.h"

namespace megablock::point_kernels {
namespace {

using lane_kernels::kByPoint;
using lane_kernels::kFromFrame;
using lane_kernels::kResidual;

// Rows v, v + 1, ... of one group of lanes.
template <int kCount>
[[gnu::always_inline]] inline void read_rows(const double* values, std::int64_t stride, Lanes (&rows)[kCount]) {
#pragma GCC unroll 64
  for (int k = 0; k < kCount; ++k) rows[k] = load(values + k * stride);
}

// Index in the lower triangle, stored by rows.
constexpr int lower(int i, int j) { return i >= j ? i * (i + 1) / 2 + j : lower(j, i); }

// Writes rows of one group of lanes as records, kWidth lanes apart from each other.
template <int kCount, typename Record, typename Write>
[[gnu::always_inline]] inline void to_records(const Lanes (&values)[kCount], Record record, Write write) {
  static_assert(kCount % kWidth == 0);
#pragma GCC unroll 64
  for (int block = 0; block < kCount; block += kWidth) {
    Lanes rows[kWidth];
#pragma GCC unroll 64
    for (int k = 0; k < kWidth; ++k) rows[k] = values[block + k];
    transpose(rows);
#pragma GCC unroll 64
    for (int lane = 0; lane < kWidth; ++lane) write(record(lane) + block, rows[lane]);
  }
}

// Writes the values of one group of lanes as records that follow each other.
[[gnu::always_inline]] inline void write_records(const Lanes (&values)[kRecordSize], double* records) {
  to_records(
      values, [&](int lane) __attribute__((always_inline)) { return records + lane * kRecordSize; },
      [](double* to, const Lanes& row) __attribute__((always_inline)) { store(to, row); });
}

// V = J_p'J_p and b = -J_p'r; j holds J_p by its two rows. J and r have the weights of the loss by now.
void normal(const double* linearised, std::int64_t linearised_stride, std::int64_t count, double* records) {
  for (std::int64_t i = 0; i < count; i += kWidth) {
    Lanes r[2], u[3], j[6], values[kRecordSize]{};
    read_rows(linearised + kResidual * linearised_stride + i, linearised_stride, r);
    read_rows(linearised + kFromFrame * linearised_stride + i, linearised_stride, u);
    read_rows(linearised + kByPoint * linearised_stride + i, linearised_stride, j);
#pragma GCC unroll 64
    for (int a = 0; a < 3; ++a) {
#pragma GCC unroll 64
      for (int b = 0; b <= a; ++b) values[kV + lower(a, b)] = j[a] * j[b] + j[3 + a] * j[3 + b];
      values[kB + a] = -(j[a] * r[0] + j[3 + a] * r[1]);
      values[kU + a] = u[a];
    }
    write_records(values, records + i * kRecordSize);
  }
}

// The loop has no branches, because the processor cannot predict which observations belong to one frame. Each record
// becomes the sum of its group so far and is stored at the place of the group; the last one of a group stays there.
// Groups never have higher numbers than their observations, so no record is overwritten before it is read.
void merge(std::int64_t count, const std::int64_t* group, double* records) {
  constexpr int kLast = kB + 2;  // last value that is summed
  constexpr int kVectors = kRecordSize / kWidth;
  Lanes sums[kVectors]{};
  LaneMask summed[kVectors];
#pragma GCC unroll 64
  for (int k = 0; k < kRecordSize; ++k) summed[k / kWidth][k % kWidth] = k <= kLast ? -1 : 0;
  std::int64_t before = -1;
  for (std::int64_t i = 0; i < count; ++i) {
    const LaneMask goes_on = LaneMask{} - (group[i] == before);
    before = group[i];
#pragma GCC unroll 64
    for (int k = 0; k < kVectors; ++k) {
      // The sum goes on within a group and begins anew behind it. u is taken from the present observation in any case.
      const LaneMask kept = reinterpret_cast<LaneMask>(sums[k]) & goes_on & summed[k];
      sums[k] = load(records + i * kRecordSize + k * kWidth) + reinterpret_cast<Lanes>(kept);
      store(records + group[i] * kRecordSize + k * kWidth, sums[k]);
    }
  }
}

void sum(std::int64_t points, const std::int64_t* begin, const double* records, double* sums) {
  for (std::int64_t p = 0; p < points; ++p) {
    Lanes sum[kRecordSize / kWidth]{};
    for (std::int64_t i = begin[p]; i < begin[p + 1]; ++i)
#pragma GCC unroll 64
      for (int k = 0; k < kRecordSize / kWidth; ++k) sum[k] += load(records + i * kRecordSize + k * kWidth);
#pragma GCC unroll 64
    for (int k = 0; k < kRecordSize / kWidth; ++k) store(sums + p * kRecordSize + k * kWidth, sum[k]);
  }
}

// Lanes behind the last point have V = 0: their pivots are held, and no value becomes infinite.
void factorise(std::int64_t count, double lambda, double floor, const double* sums, const Columns& points,
               double* steps) {
  for (std::int64_t i = 0; i < count; i += kWidth) {
    Lanes of_sums[kRecordSize];
    read_records(
        [&](int lane) __attribute__((always_inline)) { return sums + (i + lane) * kRecordSize; }, of_sums);
    const Lanes *v = of_sums + kV, *b = of_sums + kB;
    double* at = points.values + i;
    const Lanes zero{};
    Lanes held = zero;
    const auto invert = [&](const Lanes& pivot, const Lanes& diagonal) __attribute__((always_inline)) {
      const LaneMask free = pivot > floor * diagonal;
      held += free ? zero : zero + 1;
      return free ? 1 / square_root(pivot) : zero;  // the row and column of a held pivot become zero
    };
    // V + lambda diag(V) = C C', row by row, and at once the inverse of the lower triangle C, whose elements are
    //     i_kk = 1 / c_kk,  i10 = -i11 c10 i00,  i21 = -i22 c21 i11,  i20 = -i22 (c20 i00 + c21 i10).
    // A held pivot has i_kk = 0, which makes its row and column of C^-1 zero, and so its elements of z and of the step.
    const Lanes i00 = invert(v[0] + lambda * v[0], v[0]);
    const Lanes c10 = v[1] * i00, c20 = v[3] * i00;
    const Lanes i11 = invert(v[2] + lambda * v[2] - c10 * c10, v[2]);
    const Lanes c21 = (v[4] - c20 * c10) * i11;
    const Lanes i22 = invert(v[5] + lambda * v[5] - c20 * c20 - c21 * c21, v[5]);
    const Lanes i10 = -i11 * (c10 * i00);
    const Lanes i21 = -i22 * (c21 * i11);
    const Lanes i20 = -i22 * (c20 * i00 + c21 * i10);
    const Lanes z0 = i00 * b[0], z1 = i10 * b[0] + i11 * b[1], z2 = i20 * b[0] + i21 * b[1] + i22 * b[2];
    const Lanes step[kRecordSize] = {
        i00, i10, i11, i20, i21, i22, i00 * z0 + i10 * z1 + i20 * z2, i11 * z1 + i21 * z2, i22 * z2};
    write_records(step, steps + i * kRecordSize);
    const auto write = [&](int row, const Lanes* values, int number) __attribute__((always_inline)) {
#pragma GCC unroll 64
      for (int k = 0; k < number; ++k) store(at + (row + k) * points.stride, values[k]);
    };
    const Lanes z[] = {z0, z1, z2};
    write(kPointV, v, 6);
    write(kPointB, b, 3);
    write(kPointInverse, step, 6);
    write(kPointZ, z, 3);
    write(kPointOwnStep, step + 6, 3);
    write(kPointHeld, &held, 1);
  }
}

// The cross product u x m.
[[gnu::always_inline]] inline void cross(const Lanes (&u)[3], const Lanes& m0, const Lanes& m1, const Lanes& m2,
                                         Lanes (&out)[3]) {
  out[0] = u[1] * m2 - u[2] * m1;
  out[1] = u[2] * m0 - u[0] * m2;
  out[2] = u[0] * m1 - u[1] * m0;
}

// V, b and u of one group of lanes.
struct Groups {
  Lanes values[kRecordSize];
  const Lanes *v = values + kV, *b = values + kB;
  Lanes u[3];
  [[gnu::always_inline]] explicit Groups(const double* records) {
    read_records(
        [&](int lane) __attribute__((always_inline)) { return records + lane * kRecordSize; }, values);
#pragma GCC unroll 64
    for (int k = 0; k < 3; ++k) u[k] = values[kU + k];
  }
};

// `step` is C^-T z, the step of the point when all frames stay, so that T z is V_f times it.
void reduce(const double* records, std::int64_t count, const double* const* steps, double* y, double* const* frames) {
  for (std::int64_t i = 0; i < count; i += kWidth) {
    const Groups groups(records + i * kRecordSize);
    const Lanes *v = groups.v, *b = groups.b;
    const Lanes(&u)[3] = groups.u;
    Lanes of_point[kRecordSize];
    read_records(
        [&](int lane) __attribute__((always_inline)) { return steps[i + lane]; }, of_point);
    const Lanes *inverse = of_point, *step = of_point + 6;
    const Lanes zero{};

    // T = V_f C^-T. C^-1 is lower triangular, so that column c has c + 1 terms.
    Lanes t[3][3];  // T: row, column
#pragma GCC unroll 64
    for (int r = 0; r < 3; ++r)
#pragma GCC unroll 64
      for (int c = 0; c < 3; ++c) {
        t[r][c] = v[lower(r, 0)] * inverse[lower(c, 0)];
#pragma GCC unroll 64
        for (int k = 1; k <= c; ++k) t[r][c] += v[lower(r, k)] * inverse[lower(c, k)];
      }
    // Y = G'T: the rows of the rotation are [u]x T, those of the centre -T.
    Lanes columns[kYSize];
#pragma GCC unroll 64
    for (int c = 0; c < 3; ++c) {
      Lanes turned[3];
      cross(u, t[0][c], t[1][c], t[2][c], turned);
#pragma GCC unroll 64
      for (int r = 0; r < 3; ++r) {
        columns[kYStride * c + r] = turned[r];
        columns[kYStride * c + 3 + r] = -t[r][c];
      }
    }
#pragma GCC unroll 64
    for (int k = 3 * kYStride; k < kYSize; ++k) columns[k] = zero;
    to_records(
        columns, [&](int lane) __attribute__((always_inline)) { return y + (i + lane) * kYSize; },
        [](double* to, const Lanes& row) __attribute__((always_inline)) { store(to, row); });

    Lanes sums[kFrameSize];
    Lanes rest[6];  // R
#pragma GCC unroll 64
    for (int r = 0; r < 3; ++r)
#pragma GCC unroll 64
      for (int c = 0; c <= r; ++c)
        rest[lower(r, c)] = v[lower(r, c)] - (t[r][0] * t[c][0] + t[r][1] * t[c][1] + t[r][2] * t[c][2]);
    Lanes mixed[3][3];  // [column of [u]x R][row]
#pragma GCC unroll 64
    for (int c = 0; c < 3; ++c) cross(u, rest[lower(0, c)], rest[lower(1, c)], rest[lower(2, c)], mixed[c]);
#pragma GCC unroll 64
    for (int r = 0; r < 3; ++r) {
      Lanes turned[3];  // row r of [u]x R [u]x' = u x (row r of [u]x R)
      cross(u, mixed[0][r], mixed[1][r], mixed[2][r], turned);
#pragma GCC unroll 64
      for (int c = 0; c <= r; ++c) sums[kByRotation + lower(r, c)] = turned[c];
#pragma GCC unroll 64
      for (int c = 0; c < 3; ++c)
        if (3 * r + c < 8) sums[kMixed + 3 * r + c] = mixed[c][r];
    }
#pragma GCC unroll 64
    for (int k = 0; k < 6; ++k) sums[kByCentre + k] = rest[k];
#pragma GCC unroll 64
    for (int k = 0; k < 3; ++k) {
      // The diagonal of [u]x V_f [u]x': element k is w'V_f w with w = e_k x u.
      const int m = (k + 1) % 3, n = (k + 2) % 3;
      sums[kDiagonal + k] =
          u[m] * u[m] * v[lower(n, n)] - 2 * u[m] * u[n] * v[lower(m, n)] + u[n] * u[n] * v[lower(m, m)];
      sums[kDiagonal + 3 + k] = v[lower(k, k)];
    }
    Lanes left[3], turned[3];  // b_f - T z
#pragma GCC unroll 64
    for (int r = 0; r < 3; ++r)
      left[r] = b[r] - (v[lower(r, 0)] * step[0] + v[lower(r, 1)] * step[1] + v[lower(r, 2)] * step[2]);
    cross(u, left[0], left[1], left[2], turned);
#pragma GCC unroll 64
    for (int k = 0; k < 3; ++k) {
      sums[kRightHandSide + k] = turned[k];
      sums[kRightHandSide + 3 + k] = -left[k];
    }
    to_records(
        sums, [&](int lane) __attribute__((always_inline)) { return frames[i + lane]; },
        [](double* to, const Lanes& row) __attribute__((always_inline)) { store(to, load(to) + row); });
  }
}

// V_f (u x w + t) = -V_f G x_f of every group.
void move(const double* records, std::int64_t count, const double* const* motions, double* out,
          std::int64_t out_stride) {
  for (std::int64_t i = 0; i < count; i += kWidth) {
    const Groups groups(records + i * kRecordSize);
    const Lanes* v = groups.v;
    Lanes motion[8], turned[3];
    read_records(
        [&](int lane) __attribute__((always_inline)) { return motions[i + lane]; }, motion);
    cross(groups.u, motion[0], motion[1], motion[2], turned);
#pragma GCC unroll 64
    for (int k = 0; k < 3; ++k) turned[k] += motion[3 + k];
#pragma GCC unroll 64
    for (int r = 0; r < 3; ++r)
      store(out + r * out_stride + i,
            v[lower(r, 0)] * turned[0] + v[lower(r, 1)] * turned[1] + v[lower(r, 2)] * turned[2]);
  }
}

// z = C^-1 b, then x = C^-T z. Held rows of C^-1 are zero, and so are their elements of x.
void solve(std::int64_t count, const Columns& points) {
  for (std::int64_t i = 0; i < count; i += kWidth) {
    Lanes b[3], c[6];
    double* at = points.values + i;
    read_rows(at + kPointB * points.stride, points.stride, b);
    read_rows(at + kPointInverse * points.stride, points.stride, c);
    const Lanes z0 = c[0] * b[0], z1 = c[1] * b[0] + c[2] * b[1], z2 = c[3] * b[0] + c[4] * b[1] + c[5] * b[2];
    store(at + kPointOwnStep * points.stride, c[0] * z0 + c[1] * z1 + c[3] * z2);
    store(at + (kPointOwnStep + 1) * points.stride, c[2] * z1 + c[4] * z2);
    store(at + (kPointOwnStep + 2) * points.stride, c[5] * z2);
  }
}

// A column of kRows rows, in as few vectors as this processor needs. kRows is 1 to 8, or 2, 4, 6, 8.
#if MEGABLOCK_LANE_WIDTH == 8
template <int kRows>
struct Column {
  __m512d rows;
  static constexpr __mmask8 kMask = (1 << kRows) - 1;
  [[gnu::always_inline]] static Column read(const double* p) { return {_mm512_maskz_loadu_pd(kMask, p)}; }
  [[gnu::always_inline]] void write(double* p) const { _mm512_mask_storeu_pd(p, kMask, rows); }
  [[gnu::always_inline]] void subtract(const Column (&a)[3], double b0, double b1, double b2) {
    rows -= a[0].rows * b0 + a[1].rows * b1 + a[2].rows * b2;
  }
};
#else
// Vectors of four and of two. Where the processor has no vectors of four, the compiler halves them.
template <int kRows>
struct Column {
  typedef double Four __attribute__((vector_size(32)));
  typedef double Two __attribute__((vector_size(16)));
  static constexpr int kFours = kRows / 4, kTwos = kRows % 4 / 2, kOnes = kRows % 2;
  Four fours[kFours + 1];
  Two two;
  double one;
  [[gnu::always_inline]] static Column read(const double* p) {
    Column c;
#pragma GCC unroll 2
    for (int k = 0; k < kFours; ++k) __builtin_memcpy(&c.fours[k], p + 4 * k, sizeof(Four));
    if constexpr (kTwos) __builtin_memcpy(&c.two, p + 4 * kFours, sizeof(Two));
    if constexpr (kOnes) c.one = p[kRows - 1];
    return c;
  }
  [[gnu::always_inline]] void write(double* p) const {
#pragma GCC unroll 2
    for (int k = 0; k < kFours; ++k) __builtin_memcpy(p + 4 * k, &fours[k], sizeof(Four));
    if constexpr (kTwos) __builtin_memcpy(p + 4 * kFours, &two, sizeof(Two));
    if constexpr (kOnes) p[kRows - 1] = one;
  }
  [[gnu::always_inline]] void subtract(const Column (&a)[3], double b0, double b1, double b2) {
#pragma GCC unroll 2
    for (int k = 0; k < kFours; ++k) fours[k] -= a[0].fours[k] * b0 + a[1].fours[k] * b1 + a[2].fours[k] * b2;
    if constexpr (kTwos) two -= a[0].two * b0 + a[1].two * b1 + a[2].two * b2;
    if constexpr (kOnes) one -= a[0].one * b0 + a[1].one * b1 + a[2].one * b2;
  }
};
#endif

// C -= A B'. kColumns is the number of columns of C when it is known at compile time, else 0.
template <int kRows, int kColumns>
[[gnu::always_inline]] inline void subtract_block(double* c, std::int64_t c_stride, const double* a,
                                                  std::int64_t a_stride, const double* b, std::int64_t b_stride,
                                                  std::int64_t columns = kColumns) {
  using Rows = Column<kRows>;
  const Rows left[3] = {Rows::read(a), Rows::read(a + a_stride), Rows::read(a + 2 * a_stride)};
#pragma GCC unroll 8
  for (std::int64_t column = 0; column < (kColumns > 0 ? kColumns : columns); ++column) {
    Rows sum = Rows::read(c + column * c_stride);
    sum.subtract(left, b[column], b[column + b_stride], b[column + 2 * b_stride]);
    sum.write(c + column * c_stride);
  }
}

void subtract_product(double* c, std::int64_t c_stride, const double* a, std::int64_t a_stride, std::int64_t rows,
                      const double* b, std::int64_t b_stride, std::int64_t columns) {
  // The usual numbers of columns are known at compile time, so that their loops are unrolled.
  const auto block = [&]<int kRows>(std::integral_constant<int, kRows>) {
    if (columns == 6) return subtract_block<kRows, 6>(c, c_stride, a, a_stride, b, b_stride);
    if (columns == 8) return subtract_block<kRows, 8>(c, c_stride, a, a_stride, b, b_stride);
    subtract_block<kRows, 0>(c, c_stride, a, a_stride, b, b_stride, columns);
  };
  for (; rows > 8; rows -= 8, c += 8, a += 8) block(std::integral_constant<int, 8>());
  switch (rows) {  // 6 for frames and mounts, 8 for Brown's cameras
    case 1:
      return block(std::integral_constant<int, 1>());
    case 2:
      return block(std::integral_constant<int, 2>());
    case 3:
      return block(std::integral_constant<int, 3>());
    case 4:
      return block(std::integral_constant<int, 4>());
    case 5:
      return block(std::integral_constant<int, 5>());
    case 6:
      return block(std::integral_constant<int, 6>());
    case 7:
      return block(std::integral_constant<int, 7>());
    case 8:
      return block(std::integral_constant<int, 8>());
  }
}

void subtract_pairs(std::int64_t points, const std::int64_t* begin, const double* y, const std::int64_t* frames,
                    const Pairs& pairs) {
  // A block has eight rows in memory, of which six are used. Vectors of eight also read the first two values of the
  // next column of Y, and sum values without meaning into the unused rows.
  constexpr int kRows = kWidth == kPairStride ? kPairStride : 6;  // vectors of 8 values include the unused rows
  const auto subtract = [&](std::int64_t i, std::int64_t j) {
    const std::int64_t number = pair_number(frames[i], frames[j]);
    pairs.used[number] = 1;
    subtract_block<kRows, 6>(pairs.blocks + number * kPairSize, kPairStride, y + i * kYSize, kYStride, y + j * kYSize,
                             kYStride);
  };
  for (std::int64_t p = 0; p < points; ++p) {
    for (std::int64_t i = begin[p] + 1; i < begin[p + 1]; ++i) {
      for (std::int64_t j = begin[p]; j < i; ++j) {
        const bool below = frames[i] > frames[j];
        subtract(below ? i : j, below ? j : i);
      }
    }
  }
}

}  // namespace
}  // namespace megablock::point_kernels
