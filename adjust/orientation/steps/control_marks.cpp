#include "adjust/orientation/steps/control_marks.h"

#include <algorithm>

#include "adjust/tile/consistent_rays.h"

namespace megablock {

SeenMarks see_marks(const Block& block, const BlockState& state, const std::vector<FrameIndex>& frames,
                    const ControlPoint& point) {
  SeenMarks seen;
  for (const ImageMeasurement& mark : point.measurements) {
    const Image& image = block.images[mark.image];
    if (!std::binary_search(frames.begin(), frames.end(), image.frame) || !state.oriented[image.frame]) continue;
    const Pose& mount = state.mounts[block.frames[image.frame].rig][static_cast<std::size_t>(image.mount)];
    seen.marks.push_back(
        {camera_pose(state.frames[image.frame], mount), &state.cameras[block.camera_of(mark.image)], mark.pixel, 1});
  }
  // The seed only matters for more than nine marks.
  if (const auto rays = find_consistent_rays(seen.marks, kControlMark_px, 1)) seen.place = rays->point;
  return seen;
}

}  // namespace megablock
