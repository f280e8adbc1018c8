// Finds frames by the names that lists give them: their own, or that of one of their images. Internal to io/.
#pragma once

#include <map>
#include <string>

#include "io/block/block.h"

namespace megablock {

inline std::map<std::string, FrameIndex> frames_by_name(const Block& block) {
  std::map<std::string, FrameIndex> frames;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) frames.emplace(block.name_of(i), block.images[i].frame);
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) frames.emplace(block.frames[f].name, f);
  return frames;
}

}  // namespace megablock
