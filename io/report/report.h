// Writes the report of a job: one self-contained HTML page for screens, phones and paper. Styles are inline, drawings
// are SVG, and the script is short; the page loads nothing from elsewhere, so it can be sent and archived as one file.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "io/report/sections/report_context.h"
#include "io/result/result.h"
#include "io/result/track_batches.h"

namespace megablock {

// Writes the page of any result, however incomplete it is. Missing figures are left out or called missing; NaN is never
// printed. The page also contains its figures as JSON in <script type="application/json" id="figures">. The keys are
// those of `status --json` for the same figures; units are metres, pixels, and radians where named; unknown figures are
// null.
std::string report_html(const BlockResult& result, const ReportContext& context = {});
// The same for a result whose tracks are given in batches. The maps draw a sample of the tracks.
std::string report_html(BlockResult result, const TrackBatches& tracks, const ReportContext& context);

// The same in two steps. The constructor reads all tracks, which takes long, and all of the result except its digest.
class Report {
 public:
  // `after_reading` is that of ReportContext.
  Report(
      const BlockResult& result, const TrackBatches& tracks, const std::function<void()>& after_reading = [] {});
  ~Report();
  Report(Report&&) noexcept;
  // Figures that were gathered, for other summaries.
  const ReprojectionStatistics& statistics() const;
  std::vector<std::string> remarks(const BlockResult& result) const;      // io/evaluation/remarks/remarks.h
  std::string html(BlockResult result, const ReportContext& context) &&;  // consumes the gathered figures

 private:
  struct Gathered;
  std::unique_ptr<Gathered> gathered_;
};

}  // namespace megablock
