// Stores the block in a file (shapes, types and units: docs/reference/file-formats.md, "Block").
//
// The writer makes a plain HDF5 file at `path`, which JobStore::write seals. The reader throws StoreError with the name
// of the file.
#pragma once

#include <functional>
#include <string>

#include "io/block/block.h"

namespace megablock {

// `after_table` is called after every table that is written.
void write_block(const std::string& path, const Block& block, std::function<void()> after_table = {});
Block read_block(const std::string& path);
Block read_block_without_names(const std::string& path);          // everything except Block::image_names
NameTable<ImageIndex> read_image_names(const std::string& path);  // the image names alone

}  // namespace megablock
