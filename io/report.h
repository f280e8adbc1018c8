// The report of a job: one self-contained HTML page (inline styles, drawings as SVG, a few lines of script; nothing is
// fetched), for the screen, a phone and paper.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "io/block_diagnostics.h"
#include "io/result.h"
#include "io/track_batches.h"

namespace megablock {

// What the page says that is not in the result, whose bits tell no time and no place.
struct ReportContext {
  std::string job;                                               // directory
  double computed_s = std::numeric_limits<double>::quiet_NaN();  // when the result was written, since 1970
  const BlockDiagnostics* diagnostics = nullptr;                 // null: not looked for
  // Called when a section is written, and behind what a section has gone through: tables of the result that lie in a
  // file may leave memory.
  std::function<void()> after_reading = [] {};
};

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
  std::vector<std::string> remarks(const BlockResult& result) const;      // io/remarks.h
  std::string html(BlockResult result, const ReportContext& context) &&;  // hands over what was gathered

 private:
  struct Gathered;
  std::unique_ptr<Gathered> gathered_;
};

}  // namespace megablock
