// The loops over lanes of point_equations.h, by raw pointers. Lanes hold observations (adjust/observation_lanes.h) or
// points; symmetric 3 x 3 matrices are stored by the rows of their lower triangle (6), as lower triangular ones.
#pragma once

#include <cstdint>

namespace megablock::point_kernels {

// Value v of lane i: values[v * stride + i]. Counts are multiples of lane_kernels::kGroup.
struct Columns {
  double* values;
  std::int64_t stride;
};

// Of an observation, behind lane_kernels::Value: V_k = J_p'J_p and b_k = -J_p'r.
enum ObservationValue : int { kV = 0, kB = 6, kObservationValueCount = 9 };
// The same values, or C^-1 (6) and V^-1 b (3) of a point, side by side; the rest is 0.
constexpr int kRecordSize = 16;
// Of a point.
enum PointValue : int {
  kPointV = 0,  // with its prior
  kPointB = 6,
  kPointInverse = 9,   // C^-1, zero rows where held
  kPointZ = 15,        // C^-1 b
  kPointOwnStep = 18,  // C^-T z
  kPointHeld = 21,     // number of held rows
  kPointValueCount = 22
};

constexpr int kYStride = 6;  // Y of a frame: [6 x 3] column by column
constexpr int kYSize = 24;   // room of a lane, the last 6 unused
// What an observation adds to its frame (cell_assembler.h), with R = V_k - T T', T = V_k C^-T: [u]x R [u]x' and R
// (lower triangles by rows), [u]x R by rows without its last element (its trace is 0), the diagonal of G'V_k G, G'(b_k
// - T z).
enum FrameValue : int {
  kByRotation = 0,
  kByCentre = 6,
  kMixed = 12,
  kDiagonal = 20,
  kRightHandSide = 26,
  kFrameSize = 32
};

// What points add between frames (pair_blocks.h): the block of frames i >= j is number pair_number(i, j), [6 x 6]
// column by column; each column is a cache line with two values unused. used: 1 where something was added.
constexpr int kPairStride = 8, kPairSize = 6 * kPairStride;
constexpr std::int64_t pair_number(std::int64_t i, std::int64_t j) { return i * (i + 1) / 2 + j; }
struct Pairs {
  double* blocks;
  std::uint8_t* used;
};

struct Kernels {
  // From residuals and J_p (`linearised`: rows of lane_kernels::Value) to V_k and b_k, as columns and as records.
  void (*normal)(const double* linearised, std::int64_t linearised_stride, std::int64_t count, const Columns& out,
                 double* records);
  // Sums over the observations begin[p] to begin[p + 1] of each point p, as records.
  void (*sum)(std::int64_t points, const std::int64_t* begin, const double* records, double* sums);
  // Of points: from the records of V and b to all values, and to the records of C^-1 and V^-1 b. A pivot of at most
  // floor * V_kk is held.
  void (*factorise)(std::int64_t count, double lambda, double floor, const double* sums, const Columns& points,
                    double* steps);
  // Y of every observation [count x kYSize], and the sums of its frame. steps: the record of each observation's point.
  void (*reduce)(const double* linearised, std::int64_t linearised_stride, std::int64_t count, const Columns& values,
                 const double* const* steps, double* y, double* const* frames);
  // V_k (u x w + t) of the motion (w, t) of each observation's frame (8 values, two unused) to three rows.
  void (*move)(const double* linearised, std::int64_t linearised_stride, std::int64_t count, const Columns& values,
               const double* const* motions, double* out, std::int64_t out_stride);
  // Of points, from b plus what `move` gave, in kPointB, to their steps C^-T C^-1 b, in kPointOwnStep.
  void (*solve)(std::int64_t count, const Columns& points);
  // C -= A B', three columns each, leading dimensions c_stride, a_stride, b_stride; A has `rows`, B `columns` rows.
  void (*subtract_product)(double* c, std::int64_t c_stride, const double* a, std::int64_t a_stride, std::int64_t rows,
                           const double* b, std::int64_t b_stride, std::int64_t columns);
  // K_ij -= Y_i Y_j' for all pairs of observations begin[p] to begin[p + 1] of each point p, by the numbers of their
  // frames (of all observations, as y). On a diagonal block only the lower triangle counts.
  void (*subtract_pairs)(std::int64_t points, const std::int64_t* begin, const double* y, const std::int64_t* frames,
                         const Pairs& pairs);
};
extern const Kernels kPortable, kAvx2, kAvx512;

}  // namespace megablock::point_kernels
