#include "cluster/stages/common/block_tables.h"

#include "cluster/process/process_memory.h"
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

void release_names(JobBlock& own) {
  own.tables.forget(own.block.image_names.text());
  own.tables.forget(own.block.image_names.ends());
  own.block.image_names = {};
  return_freed_memory();
}

void restore_names(const JobStore& store, JobBlock& own) {
  own.block.image_names = read_image_names(store.verified_path("block.h5"));
  page_names(own.block, own.tables);
}

}  // namespace megablock
