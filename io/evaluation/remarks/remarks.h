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
// A line if sigma naught is far from 1: "Residuals are 2.3 times as large as the stated sigmas predict (variance factor
// 5.12, 41230 degrees of freedom): ...". Empty otherwise.
std::string sigma_naught_text(const BlockResult& result);
// A line if so many tie point observations of a block of several tiles with a free datum are near the limit of
// screening that the result depends on the tiles: "359 of 83718 tie point observations (0.43 %) lie within 10 % of the
// limit of screening, ...". Empty otherwise.
std::string near_limit_text(const BlockResult& result, const report::Figures& figures);
// The largest difference from one that the factor between shown and stated sigma has by chance: five standard
// deviations. The factor is sqrt(chi2 / r) with the redundancy r, and its standard deviation is about 1 / sqrt(2 r).
double chance_of_factor(double redundancy);

// All remarks of this file, of camera_remarks.h, control_remarks.h and upward_remark.h, one line each.
std::vector<std::string> remarks(const BlockResult& result);
std::vector<std::string> remarks(const BlockResult& result, const TrackBatches& tracks);
std::vector<std::string> remarks(const BlockResult& result, const report::Figures& figures);

}  // namespace megablock
