// Gives the diagnostics of a job (io/block/block_diagnostics.h), from its result or from its state before there is one.
#pragma once

#include <string>

#include "cluster/job/job_options.h"
#include "io/block/block_diagnostics.h"
#include "io/result/result.h"
#include "io/result/track_batches.h"
#include "io/store/job/job_store.h"

namespace megablock {

inline constexpr const char* kDiagnostics = "result/diagnostics.json";
inline constexpr const char* kReportPage = "result/report.html";  // the page that shows the diagnostics

// The diagnostics from the poses and kept observations of a result. Reads its tracks once.
BlockDiagnostics diagnose_result(const BlockResult& result, const TrackBatches& tracks,
                                 const DiagnosticsOptions& options);

// The diagnostics from the result of the job. Without one, from its initial orientation or given poses, and from its
// tracks, if any.
struct JobDiagnostics {
  Block block;
  BlockDiagnostics found;
  std::string source;  // origin of the poses: "the result", "the initial orientation", "the given poses"
};
JobDiagnostics diagnose_job(const JobStore& store);

}  // namespace megablock
