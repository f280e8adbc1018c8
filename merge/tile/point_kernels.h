// The loops over lanes of point_equations.h, by raw pointers. Lanes hold observations
// (adjust/lanes/observation_lanes.h), sights or points; symmetric 3 x 3 matrices are stored by the rows of their lower
// triangle (6), as lower triangular ones.
#pragma once

#include <cstdint>

namespace megablock::point_kernels {

// Value v of lane i: values[v * stride + i]. Counts are multiples of lane_kernels::kGroup.
struct Columns {
  double* values;
  std::int64_t stride;
};

// Values of an observation, of a sight or of a point side by side: V, b and, but for points, u.
enum RecordValue : int { kV = 0, kB = 6, kU = 9 };
constexpr int kRecordSize = 16;  // the rest is 0; of a sum over sights u means nothing
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
// What a sight adds to its frame (cell_assembler.h), with R = V_f - T T', T = V_f C^-T: [u]x R [u]x' and R
// (lower triangles by rows), [u]x R by rows without its last element (its trace is 0), the diagonal of G'V_f G, G'(b_f
// - T z).
enum FrameValue : int {
  kByRotation = 0,
  kByCentre = 6,
  kMixed = 12,
  kDiagonal = 20,
  kRightHandSide = 26,
  kFrameSize = 32
};

// What points add between frames (pair_blocks.h): the block of frames i > j is number pair_number(i, j), [6 x 6]
// column by column; each column is a cache line with two values unused. used: 1 where something was added.
constexpr int kPairStride = 8, kPairSize = 6 * kPairStride;
constexpr std::int64_t pair_number(std::int64_t i, std::int64_t j) { return i * (i - 1) / 2 + j; }
struct Pairs {
  double* blocks;
  std::uint8_t* used;
};

struct Kernels {
  // From residuals, u and J_p (`linearised`: rows of lane_kernels::Value) to the observations' records.
  void (*normal)(const double* linearised, std::int64_t linearised_stride, std::int64_t count, double* records);
  // From the records of observations to those of sights, in their place: V and b are sums, u is the last one's, which
  // all have. sight[k]: of observation k, the one before's or the next one.
  void (*merge)(std::int64_t count, const std::int64_t* sight, double* records);
  // Sums over the sights begin[p] to begin[p + 1] of each point p, as records.
  void (*sum)(std::int64_t points, const std::int64_t* begin, const double* records, double* sums);
  // Of points: from the records of V and b to all values, and to C^-1 (6) and V^-1 b (3) as a record's first values. A
  // pivot of at most floor * V_kk is held.
  void (*factorise)(std::int64_t count, double lambda, double floor, const double* sums, const Columns& points,
                    double* steps);
  // Y of every sight [count x kYSize], and the sums of its frame. steps: what factorise gave for each sight's point.
  void (*reduce)(const double* records, std::int64_t count, const double* const* steps, double* y,
                 double* const* frames);
  // V_f (u x w + t) of the motion (w, t) of each sight's frame (8 values, two unused) to three rows.
  void (*move)(const double* records, std::int64_t count, const double* const* motions, double* out,
               std::int64_t out_stride);
  // Of points, from b plus what `move` gave, in kPointB, to their steps C^-T C^-1 b, in kPointOwnStep.
  void (*solve)(std::int64_t count, const Columns& points);
  // C -= A B', three columns each, leading dimensions c_stride, a_stride, b_stride; A has `rows`, B `columns` rows.
  void (*subtract_product)(double* c, std::int64_t c_stride, const double* a, std::int64_t a_stride, std::int64_t rows,
                           const double* b, std::int64_t b_stride, std::int64_t columns);
  // K_ij -= Y_i Y_j' for all pairs of sights begin[p] to begin[p + 1] of each point p, by the numbers of their frames
  // (of all sights, as y), which are different ones.
  void (*subtract_pairs)(std::int64_t points, const std::int64_t* begin, const double* y, const std::int64_t* frames,
                         const Pairs& pairs);
};
extern const Kernels kPortable, kAvx2, kAvx512;

}  // namespace megablock::point_kernels
