// Keeps the large tables of the block out of the memory of a rank while stages work on tiles.
#pragma once

#include "cluster/job/job.h"

namespace megablock {

// Moves frames, images with their names, and relative poses to the disk: 100 MB for a million images of ten cameras.
void page_tables(const Block& block, PagedTables& tables);

// Frees the names of images, which tiles, tracks and adjustments do not need. They are a third of that size.
void release_names(JobBlock& own);
void restore_names(const JobStore& store, JobBlock& own);

}  // namespace megablock
