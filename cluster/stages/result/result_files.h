// What a job leaves in its folder 'result': the result itself, its figures, what the block lacks, and the report.
#pragma once

#include <cstdint>
#include <vector>

#include "cluster/job/paged_tables.h"
#include "cluster/stages/result/result_parts.h"
#include "io/block/block_diagnostics.h"
#include "io/result/result.h"
#include "io/store/job/job_store.h"

namespace megablock {

// `result` without its tracks, which are in `parts`. Its tables that grow with the block lie in `tables` and leave
// memory behind each batch of tracks, dataset and section that asked for them.
void write_result_files(const JobStore& store, PagedTables& tables, std::uint64_t fingerprint, BlockResult result,
                        std::vector<PartTracks::File> parts, const DiagnosticsOptions& options);

}  // namespace megablock
