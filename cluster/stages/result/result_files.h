// Writes the folder `result` of a job: the result, its figures, the diagnostics of the block, and the report.
#pragma once

#include <cstdint>
#include <vector>

#include "cluster/job/paged_tables.h"
#include "cluster/stages/result/result_parts.h"
#include "io/block/block_diagnostics.h"
#include "io/result/result.h"
#include "io/store/job/job_store.h"

namespace megablock {

// `result` has no tracks; these are in `parts`. The tables of `result` that grow with the block are in `tables`, and
// they leave memory after each batch of tracks, dataset and section that has used them.
void write_result_files(const JobStore& store, PagedTables& tables, std::uint64_t fingerprint, BlockResult result,
                        std::vector<PartTracks::File> parts, const DiagnosticsOptions& options);

}  // namespace megablock
