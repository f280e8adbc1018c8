// Declares the loops over lanes of point_equations.h, on raw pointers. Lanes hold observations
// (adjust/lanes/observation_lanes.h), the observations of a point in one frame (a group), or points. Symmetric 3 x 3
// matrices are stored by the rows of their lower triangle (6 values), and triangular ones in the same way.
//
// Two layouts meet here. Where all lanes do the same arithmetic, a value has a column over the lanes (Columns). Where
// lanes must be gathered (a point sums its observations, a group reads the step of its point), all values of one lane
// lie together as a record of two lines of the cache, and the kernels transpose records and columns in registers.
#pragma once

#include <cstdint>

namespace megablock::point_kernels {

// Value v of lane i: values[v * stride + i]. Counts are multiples of lane_kernels::kGroup.
struct Columns {
  double* values;
  std::int64_t stride;
};

// The values of an observation, of a group or of a point side by side: V, b and, except for points, u.
enum RecordValue : int { kV = 0, kB = 6, kU = 9 };
constexpr int kRecordSize = 16;  // the rest is 0; in the sum over a point u has no meaning
// The values of a point.
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
constexpr int kYSize = 24;   // values of one Y in memory, the last 6 unused
// The contribution of a group to its frame (cell_assembler.h), with R = V_f - T T' and T = V_f C^-T: [u]x R [u]x' and
// R (lower triangles by rows), [u]x R by rows without its last element (its trace is 0), the diagonal of G'V_f G, and
// G'(b_f - T z).
enum FrameValue : int {
  kByRotation = 0,
  kByCentre = 6,
  kMixed = 12,
  kDiagonal = 20,
  kRightHandSide = 26,
  kFrameSize = 32
};

// The contributions of points between two frames (pair_blocks.h). The block of frames i > j has the number
// pair_number(i, j) and is [6 x 6] column by column; each column is a cache line with two values unused. `used` is 1
// where something was added.
constexpr int kPairStride = 8, kPairSize = 6 * kPairStride;
constexpr std::int64_t pair_number(std::int64_t i, std::int64_t j) { return i * (i - 1) / 2 + j; }
struct Pairs {
  double* blocks;
  std::uint8_t* used;
};

// Each lane does the same operations in the same order in all three versions, so that they give the same bits. Pointers
// and counts are not checked.
struct Kernels {
  // Makes the records of observations from residuals, u and J_p (`linearised`: rows of lane_kernels::Value).
  void (*normal)(const double* linearised, std::int64_t linearised_stride, std::int64_t count, double* records);
  // Makes the records of groups from those of their observations, in place. V and b are sums; u is the same for all
  // observations of a group. For observation k, group[k] is that of the observation before it, or the next number.
  void (*merge)(std::int64_t count, const std::int64_t* group, double* records);
  // Sums the records from begin[p] to begin[p + 1] for each point p, into records.
  void (*sum)(std::int64_t points, const std::int64_t* begin, const double* records, double* sums);
  // Factorises V of points. Fills all their values from the records of V and b, and writes C^-1 (6) and V^-1 b (3) as
  // the first values of a record for each point. A pivot of at most floor * V_kk is held.
  void (*factorise)(std::int64_t count, double lambda, double floor, const double* sums, const Columns& points,
                    double* steps);
  // Computes Y of every group [count x kYSize], and adds to the sums of its frame. `steps` points to the record that
  // factorise wrote for the point of each.
  void (*reduce)(const double* records, std::int64_t count, const double* const* steps, double* y,
                 double* const* frames);
  // Writes V_f (u x w + t) to three rows. (w, t) is the motion of each frame (8 values, two unused).
  void (*move)(const double* records, std::int64_t count, const double* const* motions, double* out,
               std::int64_t out_stride);
  // Solves for the steps C^-T C^-1 b of points, from b plus the results of `move` in kPointB, into kPointOwnStep.
  void (*solve)(std::int64_t count, const Columns& points);
  // C -= A B', each of three columns, with leading dimensions c_stride, a_stride, b_stride; A has `rows`, B `columns`
  // rows.
  void (*subtract_product)(double* c, std::int64_t c_stride, const double* a, std::int64_t a_stride, std::int64_t rows,
                           const double* b, std::int64_t b_stride, std::int64_t columns);
  // K_ij -= Y_i Y_j' for all pairs i, j from begin[p] to begin[p + 1] of each point p. `frames` holds the number of the
  // frame for each Y of `y`; the numbers of one point differ.
  void (*subtract_pairs)(std::int64_t points, const std::int64_t* begin, const double* y, const std::int64_t* frames,
                         const Pairs& pairs);
};
extern const Kernels kPortable, kAvx2, kAvx512;

}  // namespace megablock::point_kernels
