// Gives the names of the images of a block, for tests.
#pragma once

#include <string>
#include <vector>

#include "io/base/name_table.h"
#include "io/block/block.h"

namespace megablock {

inline std::vector<std::string> image_names(const Block& block) {
  std::vector<std::string> names;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) names.push_back(block.name_of(i));
  return names;
}

// Each image gets the name new_name(image).
template <typename NewName>
void rename_images(Block& block, const NewName& new_name) {
  NameTable<ImageIndex> names;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) names.push_back(new_name(i));
  block.image_names = names;
}

}  // namespace megablock
