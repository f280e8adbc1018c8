// The block's large tables on a rank: where they are while stages work on tiles.
#pragma once

#include "cluster/job/job.h"

namespace megablock {

// Frames, images and their names, and relative poses go to the disk; a million images of ten cameras take 100 MB.
void page_tables(const Block& block, PagedTables& tables);

// Tiles, tracks and adjustments do without the names of images, a third as much again.
void release_names(Job& job);
void restore_names(Job& job);

}  // namespace megablock
