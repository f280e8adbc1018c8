// Finds the connected parts of a block. Two frames are connected if both have a kept observation of the same tie,
// control or check point, or if there is a relative pose between them.
//
// The representative of a set is its first frame (io/base/disjoint_sets.h). A track unites each of its frames with the
// previous one, which needs one union per observation.
#include "io/evaluation/parts.h"

#include <algorithm>
#include <cmath>

#include "io/base/disjoint_sets.h"

namespace megablock::report {

namespace {

std::int64_t frame_at(const BlockResult& result, ImageIndex image) { return result.block.images[image].frame.value; }

void join_tie_points(const BlockResult& result, const TrackResults& batch, DisjointSets& sets) {
  for (std::size_t t = 0; t + 1 < batch.tracks.begin.size(); ++t) {
    if (t >= batch.points.size() || !batch.points[t].allFinite()) continue;
    std::int64_t first = -1;
    for (std::int64_t o = batch.tracks.begin[t]; o < batch.tracks.begin[t + 1]; ++o) {
      const auto i = static_cast<std::size_t>(o);
      if (i >= batch.kept.size() || !batch.kept[i]) continue;
      const std::int64_t frame = frame_at(result, batch.tracks.image[i]);
      if (first >= 0) sets.unite(first, frame);
      first = frame;
    }
  }
}

void join_control_points(const BlockResult& result, DisjointSets& sets) {
  for (std::size_t p = 0; p < std::min(result.control.size(), result.block.control_points.size()); ++p) {
    const auto& measurements = result.block.control_points[p].measurements;
    const ImageMeasurement* first = nullptr;
    for (std::size_t m = 0; m < std::min(measurements.size(), result.control[p].residual_px.size()); ++m) {
      if (!result.control[p].takes_part(m)) continue;
      if (first) sets.unite(frame_at(result, first->image), frame_at(result, measurements[m].image));
      first = &measurements[m];
    }
  }
}

}  // namespace

void find_parts(const BlockResult& result, const TrackBatches& tracks, Figures& figures) {
  const std::size_t frames = result.block.frames.size();
  DisjointSets sets(static_cast<std::int64_t>(frames));
  tracks.visit([&](const TrackResults& batch) { join_tie_points(result, batch, sets); });
  join_control_points(result, sets);
  for (const RelativePose& relative : result.block.relative_poses)
    if (oriented(result, relative.from) && oriented(result, relative.to))
      sets.unite(relative.from.value, relative.to.value);

  std::vector<std::size_t> size(frames, 0), roots;
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value)
    if (oriented(result, f)) ++size[static_cast<std::size_t>(sets.find(f.value))];
  for (std::size_t f = 0; f < frames; ++f)
    if (size[f] > 0) roots.push_back(f);
  std::stable_sort(roots.begin(), roots.end(), [&](std::size_t a, std::size_t b) { return size[a] > size[b]; });
  std::vector<std::int32_t> row(frames, -1);
  for (std::size_t r = 0; r < roots.size(); ++r) row[roots[r]] = static_cast<std::int32_t>(r);

  figures.parts.assign(roots.size(), {});
  figures.part_of_frame.assign(frames, -1);
  for (FrameIndex frame(0); figures.part_of_frame.contains(frame); ++frame.value) {
    if (!oriented(result, frame)) continue;
    figures.part_of_frame[frame] = row[static_cast<std::size_t>(sets.find(frame.value))];
    ++figures.parts[static_cast<std::size_t>(figures.part_of_frame[frame])].frames;
  }
  for (const Image& image : result.block.images)
    if (figures.part_of_frame[image.frame] >= 0)
      ++figures.parts[static_cast<std::size_t>(figures.part_of_frame[image.frame])].images;
  for (const FreePart& part : result.free_parts) {
    if (!figures.part_of_frame.contains(part.frame) || figures.part_of_frame[part.frame] < 0) continue;
    int& defect = figures.parts[static_cast<std::size_t>(figures.part_of_frame[part.frame])].defect;
    // If several free parts lie in one part, the worst counts.
    defect = std::max<int>(defect, part.defect);
  }
}

}  // namespace megablock::report
