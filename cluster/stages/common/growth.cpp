#include "cluster/stages/common/growth.h"

#include <algorithm>

namespace megablock {

std::int64_t frames_of_first_images(const Block& block, std::int64_t n) {
  std::int64_t frames = 0;
  for (std::int64_t i = 0; i < n; ++i) frames = std::max(frames, block.images[ImageIndex(i)].frame.value + 1);
  return frames;
}

Block first_images(const Block& block, std::int64_t n) {
  Block part = block;
  part.images.resize(static_cast<std::size_t>(n));
  part.image_names = {};
  for (ImageIndex i(0); i.value < n; ++i.value) part.image_names.push_back(block.image_names[i]);
  std::int64_t rigs = 0, cameras = 0;
  part.frames.resize(static_cast<std::size_t>(frames_of_first_images(block, n)));
  for (const Frame& frame : part.frames) {
    rigs = std::max(rigs, frame.rig.value + 1);
    if (frame.position_prior) rigs = std::max(rigs, frame.position_prior->group.value + 1);
  }
  part.rigs.resize(static_cast<std::size_t>(rigs));
  for (const Rig& rig : part.rigs)
    for (const Mount& mount : rig.cameras()) cameras = std::max(cameras, mount.camera.value + 1);
  part.cameras.resize(static_cast<std::size_t>(cameras));
  part.relative_poses.clear();
  part.frame_measurements.clear();
  part.control_points.clear();
  part.lines.clear();
  std::erase_if(part.verticals, [&](const SeenVertical& vertical) { return vertical.image.value >= n; });
  return part;
}

std::size_t generation_of(const std::vector<std::int64_t>& generations, ImageIndex image) {
  return static_cast<std::size_t>(std::upper_bound(generations.begin(), generations.end(), image.value) -
                                  generations.begin());
}

}  // namespace megablock
