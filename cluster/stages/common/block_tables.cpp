#include "cluster/stages/common/block_tables.h"

#include "io/store/units/block_file.h"

namespace megablock {

namespace {

void page_names(const Block& block, PagedTables& tables) {
  tables.put(block.image_names.text());
  tables.put(block.image_names.ends());
}

}  // namespace

void page_tables(const Block& block, PagedTables& tables) {
  page_names(block, tables);
  tables.put(block.frames);
  tables.put(block.images);
  tables.put(block.relative_poses);
}

void release_names(Job& job) {
  job.tables.forget(job.block.image_names.text());
  job.tables.forget(job.block.image_names.ends());
  job.block.image_names = {};
  return_freed_memory();
}

void restore_names(Job& job) {
  job.block.image_names = read_image_names(job.store.verified_path("block.h5"));
  page_names(job.block, job.tables);
}

}  // namespace megablock
