// Lists the weaknesses of a result that its reader must not overlook. The terminal and the report print the same texts,
// which are therefore plain text without markup. The seam check and the notes of a run have lines of their own
// (merge/checks/seam_check.h, cluster/job/messages.h).
#pragma once

#include <string>
#include <vector>

#include "io/result/result.h"
#include "io/result/track_batches.h"

namespace megablock {

namespace report {
struct Figures;
}

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

// "2 control points take no part: 3 (1.4e6 px in 02.jpg, 31 px in 04.jpg, rejected), 7 (not seen by an oriented
// image)"; empty if there are none.
std::string unused_points_text(const BlockResult& result, PointRole role);

// One line for each part of the block whose datum the observations do not determine, or whose rotations they determine
// only to several degrees: "The datum is free: nothing determines the rotation about the line of the positions (sigma
// of the rotations 28 degrees): ... add attitudes or control points ...". Empty if the datum is well determined.
std::vector<std::string> datum_texts(const BlockResult& result);
// `figures` needs only its parts and position residuals.
std::vector<std::string> datum_texts(const BlockResult& result, const report::Figures& figures);

// One line for each kind of observation whose residuals are several times as large as the stated sigmas predict, with
// advice. Sigma naught does not show such kinds, because tie points, which are far more, dominate it. The residuals of
// tie points are compared with the sigma that the options of the job assume, even if their sigma was estimated.
std::vector<std::string> misstated_texts(const BlockResult& result);
// Single positions and attitudes that the block contradicts by many times their sigmas, one line for each of the two
// kinds, which names the worst: "6 of 18 attitudes differ from the block by more than 6 sigmas: DJI_0034.JPG by 178.9
// degrees, ...". Robust losses give them little weight, so they hardly appear in the statistics of their kind.
std::vector<std::string> contradicted_texts(const BlockResult& result, const report::Figures& figures);
// The control and check points that the block contradicts, and single marks that were rejected, one line each:
// "1 of 10 control points differs from the block by more than 6 sigmas and has hardly any weight: gcp02 by 10.0 m (its
// marks fit within 0.4 px); check its coordinates and its name", "1 mark of control and check points is rejected: gcp05
// in IMG_0043.JPG by 312 px". A point of which no mark takes part is in unused_points_text.
std::vector<std::string> wrong_control_texts(const BlockResult& result);
// A line if so many tie point observations of a block with a free datum are near the limit of screening that the result
// depends on the tiles: "359 of 83718 tie point observations (0.43 %) lie within 10 % of the limit of screening, ...".
// Empty otherwise.
std::string near_limit_text(const BlockResult& result, const report::Figures& figures);
// The largest difference from one that the factor between shown and stated sigma has by chance: five standard
// deviations. The factor is sqrt(chi2 / r) with the redundancy r, and its standard deviation is about 1 / sqrt(2 r).
double chance_of_factor(const ObservationStatistics& statistics);

// All remarks of this file, one line each.
std::vector<std::string> remarks(const BlockResult& result);
std::vector<std::string> remarks(const BlockResult& result, const TrackBatches& tracks);
std::vector<std::string> remarks(const BlockResult& result, const report::Figures& figures);

}  // namespace megablock
