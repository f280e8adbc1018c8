// The report of a job: one self-contained HTML page (inline styles, drawings as SVG, a few lines of script; nothing is
// fetched), for the screen, a phone and paper.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "io/report/sections/report_context.h"
#include "io/result/result.h"
#include "io/result/track_batches.h"

namespace megablock {

// Works for any result, however incomplete: what was not computed is left out or said to be missing, and no figure that
// is not a number is printed. The page carries its figures as JSON in <script type="application/json" id="figures">
// (keys as `status --json` where they are the same; metres, radians as named, pixels; null where unknown).
std::string report_html(const BlockResult& result, const ReportContext& context = {});
// Of a result without tracks and all of these; maps draw a sample of them.
std::string report_html(BlockResult result, const TrackBatches& tracks, const ReportContext& context);

// The same in two steps. The first one goes through the tracks, which takes its time, and reads all of the result but
// its digest.
class Report {
 public:
  // `after_reading` as in ReportContext.
  Report(
      const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading = [] {});
  ~Report();
  Report(Report&&) noexcept;
  // Of what was gathered, for other summaries.
  const ReprojectionStatistics& statistics() const;
  std::vector<std::string> remarks(const BlockResult& result) const;      // io/evaluation/remarks.h
  std::string html(BlockResult result, const ReportContext& context) &&;  // hands over what was gathered

 private:
  struct Gathered;
  std::unique_ptr<Gathered> gathered_;
};

}  // namespace megablock
