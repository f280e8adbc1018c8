// Names the control and check points, and the marks, that contradict a block or take no part in it, as plain text for
// terminal and report. remarks.h has the other remarks.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "io/result/result.h"

namespace megablock {

// What all remarks on single observations have in common.
inline constexpr std::size_t kNamedInLine = 5;  // number of points or frames that a line names
inline constexpr double kContradictedSigmas =
    6;  // sigmas; one of 14 million normal deviates in three dimensions is larger
// The limit that a remark states where the smallest difference is this one: the test without the observation, which
// sets gross errors aside, is sharper than that of all differences.
inline double shown_limit(double smallest) { return std::min(kContradictedSigmas, std::floor(smallest)); }

// A control or check point without any measurement that takes part: all were rejected, or none is in an oriented image.
struct UnusedPoint {
  std::size_t point = 0;  // row of block.control_points
  struct Mark {
    double px = 0;  // residual
    ImageIndex image;
  };
  std::vector<Mark> marks;  // in oriented images, the worst first
  double worst_px() const { return marks.empty() ? 0 : marks.front().px; }
};
// The unused points, worst first. Empty if the result has no points.
std::vector<UnusedPoint> unused_points(const BlockResult& result, PointRole role);

// "2 control points take no part: 3 (more than 100 000 px in 02.jpg, 31 px in 04.jpg, rejected), 7 (not seen by an
// oriented image)"; empty if there are none.
std::string unused_points_text(const BlockResult& result, PointRole role);

// The control and check points that the block contradicts, and single marks that were rejected, one line each:
// "1 of 10 control points differs from the block by more than 6 sigmas and has hardly any weight: gcp02 by 10.0 m (its
// marks fit within 0.4 px); check its coordinates and its name", "1 mark of control and check points is rejected: gcp05
// in IMG_0043.JPG by 312 px". Fewer than five control points, without positions that check them, are all named: "The 3
// control points contradict each other: ...". Where all points are off by one height, one line says so and blames none:
// "2 control points and 4 check points lie 47.0 m below the block that the positions place: ...". A point of which no
// mark takes part is in unused_points_text.
std::vector<std::string> wrong_control_texts(const BlockResult& result);
}  // namespace megablock
