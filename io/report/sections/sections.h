// Writes the sections of the report, in the order of the page. A section without contents is an empty text.
//
// The figures were gathered before (io/evaluation/figures.h), so only the maps read tracks, and only a sample of them.
// Internal to io/: it is not installed.
#pragma once

#include <functional>
#include <string>

#include "io/evaluation/figures.h"
#include "io/report/sections/report_context.h"
#include "io/result/result.h"

namespace megablock::report {

inline constexpr double kGrossRatio = 3;  // differences of more than so many sigmas are marked

bool alarms(const SeamCheck& seam);
double sigmas_apart(const SeamCheck& seam);  // difference of its two sides, over what their sigmas explain
std::string time_text(double since_1970_s);  // "2026-11-21 10:55 UTC"; empty if unknown
// The unit of lengths in the ground frame: "m", or "units" where the scale of the largest part of the block is
// arbitrary.
const char* ground_unit(const Figures& figures);
// Empty without covariances. `after_reading` is that of ReportContext, here and below.
std::string ellipses_figure(const BlockResult& result, const Figures& figures,
                            const std::function<void()>& after_reading);

// Cards with the main figures: images, points, observations, residual, sigma naught, resolution, tiles, iterations,
// time.
std::string headline(const BlockResult& result, const Figures& figures);
// Strengths and weaknesses. `diagnostics`: null where the block is not diagnosed.
std::string assessment(const BlockResult& result, const Figures& figures, const BlockDiagnostics* diagnostics);
// Maps of the placed frames, and one of each part whose datum is free.
std::string map_section(const BlockResult& result, const Figures& figures, const std::function<void()>& after_reading);
std::string coverage_section(const BlockResult& result, const Figures& figures,
                             const std::function<void()>& after_reading);
// Gaps, thin ground, bases and weak links (io/block/block_diagnostics.h).
std::string diagnostics_section(const BlockResult& result, const Figures& figures, const BlockDiagnostics& diagnostics);
std::string images_section(const BlockResult& result, const Figures& figures,
                           const std::function<void()>& after_reading);
// Histograms of track lengths, intersection angles and observations per image.
std::string tie_points_section(const BlockResult& result, const Figures& figures,
                               const std::function<void()>& after_reading);
// The histogram of residual components, and the residual field of each camera.
std::string residuals_section(const BlockResult& result, const Figures& figures);
// Redundancy and shown sigma of each kind of observation, and the tests of single ones.
std::string observations_section(const BlockResult& result, const Figures& figures);
// Residuals of positions and attitudes that are not held.
std::string positions_section(const BlockResult& result, const Figures& figures);
std::string attitudes_section(const BlockResult& result, const Figures& figures);
std::string control_section(const BlockResult& result, const Figures& figures);
std::string cameras_section(const BlockResult& result, const Figures& figures);
// Posterior sigmas of frames and tie points, with the map of error ellipses.
std::string accuracy_section(const BlockResult& result, const Figures& figures,
                             const std::function<void()>& after_reading);
// Tiles, and the seam checks of the merge tree with the largest excess first.
std::string tiles_section(const BlockResult& result, const Figures& figures);
std::string failures_section(const BlockResult& result, const Figures& figures);
std::string stages_section(const BlockResult& result);
std::string provenance_section(const BlockResult& result, const ReportContext& context);

}  // namespace megablock::report
