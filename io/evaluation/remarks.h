// What a reader of a result must not overlook, in plain words without markup: for the terminal and the report.
#pragma once

#include <string>
#include <vector>

#include "io/result/result.h"
#include "io/result/track_batches.h"

namespace megablock {

namespace report {
struct Figures;
}

// A control or check point that no measurement holds: all were rejected, or none lies in an oriented image.
struct UnusedPoint {
  std::size_t point = 0;  // in block.control_points
  ImageIndex image;       // of the worst measurement; invalid: none lies in an oriented image
  double worst_px = 0;    // its residual
};
// Worst first; none when the result holds no points.
std::vector<UnusedPoint> unused_points(const BlockResult& result, PointRole role);

// "2 control points take no part: 3 (1.4e6 px in 02.jpg), 7 (not seen by an oriented image)"; empty without such.
std::string unused_points_text(const BlockResult& result, PointRole role);

// What the observations leave undetermined of the datum, a line per part of the block whose datum is free, and whether
// its rotations are known to several degrees only: "The datum is free: nothing determines the rotation about the line
// of the positions (sigma of the rotations 28 degrees): ... add attitudes or control points ...". Empty for a sound
// datum.
std::vector<std::string> datum_texts(const BlockResult& result);
std::vector<std::string> datum_texts(const BlockResult& result, const report::Figures& figures);  // parts are enough

// Kinds of observations whose residuals are several times what their stated sigmas let expect, a line each, with what
// can be done. Sigma naught does not show them: it is that of the tie points, which are many. Of tie points: several
// times what the job's options assume, however their sigma was estimated.
std::vector<std::string> misstated_texts(const BlockResult& result);
// Single positions and attitudes that the block contradicts by many times their sigmas, a line for each of the two, the
// worst by name: "6 of 18 attitudes differ from the block by more than 6 sigmas: DJI_0034.JPG by 178.9 degrees, ...".
// Robust losses keep them from bending the block, and so from the statistics of their kind.
std::vector<std::string> contradicted_texts(const BlockResult& result, const report::Figures& figures);
// Whether so many tie point observations of a block without a datum of its own are near the limit of screening that the
// result depends on the tiles: "359 of 83718 tie point observations (0.43 %) lie within 10 % of the limit of screening,
// ...". Empty where not.
std::string near_limit_text(const BlockResult& result, const report::Figures& figures);
// By how much a factor between shown and stated sigma differs from one by chance: five standard deviations.
double chance_of_factor(const ObservationStatistics& statistics);

// All of this file, one line each.
std::vector<std::string> remarks(const BlockResult& result);
std::vector<std::string> remarks(const BlockResult& result, const TrackBatches& tracks);
std::vector<std::string> remarks(const BlockResult& result, const report::Figures& figures);

}  // namespace megablock
