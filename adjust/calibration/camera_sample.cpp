// The nearest frames see each other's points in any kind of block: neighbours of a strip and of the strips beside it,
// images round an object, both drives of a street.
#include "adjust/calibration/camera_sample.h"

#include <algorithm>
#include <map>
#include <set>

namespace megablock {

namespace {

Eigen::Vector3d middle_of(const BlockState& state, const std::vector<FrameIndex>& frames) {
  Eigen::Vector3d middle;
  std::vector<double> values(frames.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(frames.begin(), frames.end(), values.begin(),
                   [&](FrameIndex f) { return state.frames[f].centre[axis]; });
    const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), half, values.end());
    middle[axis] = *half;
  }
  return middle;
}

}  // namespace

std::vector<FrameIndex> frames_near_the_middle(const Block& block, const BlockState& state, RigIndex rig,
                                               const IndexedVector<FrameIndex, std::int32_t>& component,
                                               std::int64_t max_frames) {
  std::vector<FrameIndex> frames;
  // The largest component of the rig; with equally many frames the lower number.
  std::map<std::int32_t, std::int64_t> sizes;
  const auto usable = [&](FrameIndex f) {
    return block.frames[f].rig == rig && state.oriented[f] && component[f] >= 0;
  };
  for (FrameIndex f(0); block.frames.contains(f); ++f.value)
    if (usable(f)) ++sizes[component[f]];
  if (sizes.empty()) return frames;
  const auto largest =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  for (FrameIndex f(0); block.frames.contains(f); ++f.value)
    if (usable(f) && component[f] == largest->first) frames.push_back(f);
  const Eigen::Vector3d middle = middle_of(state, frames);
  std::stable_sort(frames.begin(), frames.end(), [&](FrameIndex a, FrameIndex b) {
    return (state.frames[a].centre - middle).squaredNorm() < (state.frames[b].centre - middle).squaredNorm();
  });
  if (std::ssize(frames) > max_frames) frames.resize(static_cast<std::size_t>(max_frames));
  std::sort(frames.begin(), frames.end());
  return frames;
}

TrackSet tracks_in_frames(const Block& block, const Measurements& observations, std::int64_t max_observations) {
  // Observations come by image, so that those of a track are ascending and the tracks appear by their first ones.
  std::map<std::pair<TileIndex, TrackIndex>, std::vector<std::int64_t>> rows;
  for (std::int64_t o = 0; o < observations.size(); ++o)
    rows[{observations.tile[static_cast<std::size_t>(o)], observations.track[static_cast<std::size_t>(o)]}].push_back(
        o);
  std::vector<std::vector<std::int64_t>> tracks;
  std::int64_t count = 0;
  for (auto& [track, own] : rows) {
    std::set<FrameIndex> frames;
    for (const std::int64_t o : own) frames.insert(block.images[observations.image[static_cast<std::size_t>(o)]].frame);
    if (frames.size() < 2) continue;  // it says nothing of its distance
    count += std::ssize(own);
    tracks.push_back(std::move(own));
  }
  // Rows of one image are by tile; the values of the observations themselves order them alike in every division.
  const auto key = [&](const std::vector<std::int64_t>& own) {
    const auto first = static_cast<std::size_t>(own.front());
    return std::tuple(observations.image[first], observations.x[first], observations.y[first],
                      observations.feature[first]);
  };
  std::sort(tracks.begin(), tracks.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
  const auto step =
      static_cast<std::size_t>(std::max<std::int64_t>(1, (count + max_observations - 1) / max_observations));
  TrackSet result;
  result.begin.push_back(0);
  for (std::size_t t = 0; t < tracks.size(); t += step) {
    result.id.push_back(TrackIndex(static_cast<std::int64_t>(result.id.size())));
    for (const std::int64_t o : tracks[t]) {
      const auto row = static_cast<std::size_t>(o);
      result.image.push_back(observations.image[row]);
      result.x.push_back(observations.x[row]);
      result.y.push_back(observations.y[row]);
      result.feature.push_back(observations.feature[row]);
    }
    result.begin.push_back(result.observation_count());
  }
  return result;
}

}  // namespace megablock
