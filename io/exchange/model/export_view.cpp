#include "io/exchange/model/export_view.h"

namespace megablock {

Pose ExportView::pose(std::int64_t i) const {
  const Image& entry = image(i);
  const RigIndex rig = result.block.frames[entry.frame].rig;
  return camera_pose(result.state.frames[entry.frame], result.state.mounts[rig][static_cast<std::size_t>(entry.mount)]);
}

Eigen::Vector2d ExportView::pixel(std::int64_t observation) const {
  const auto row_index = static_cast<std::size_t>(observation);
  return {from_fixed_pixel(result.tracks.x[row_index]), from_fixed_pixel(result.tracks.y[row_index])};
}

ExportView make_export_view(const BlockResult& result) {
  ExportView view{result, {}, {}, {}, {0}, {}};
  for (std::size_t i = 0; i < result.block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const bool oriented = result.state.oriented[result.block.images[image].frame] != 0;
    view.row.push_back(oriented ? view.image_count() : -1);
    if (oriented) view.images.push_back(image);
  }
  const TrackSet& tracks = result.tracks;
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    const auto track = static_cast<std::size_t>(t);
    if (!result.points[track].allFinite()) continue;
    const std::size_t before = view.observations.size();
    for (std::int64_t o = tracks.begin[track]; o < tracks.begin[track + 1]; ++o)
      if (result.kept[static_cast<std::size_t>(o)] && view.image_of(o) >= 0) view.observations.push_back(o);
    // One ray alone determines no point.
    if (view.observations.size() < before + 2) {
      view.observations.resize(before);
      continue;
    }
    view.tracks.push_back(t);
    view.begin.push_back(static_cast<std::int64_t>(view.observations.size()));
  }
  return view;
}

ObservationsByImage observations_by_image(const ExportView& view) {
  ObservationsByImage by_image;
  by_image.begin.assign(view.images.size() + 1, 0);
  for (const std::int64_t o : view.observations) ++by_image.begin[static_cast<std::size_t>(view.image_of(o)) + 1];
  for (std::size_t i = 1; i < by_image.begin.size(); ++i) by_image.begin[i] += by_image.begin[i - 1];
  std::vector<std::int64_t> next(by_image.begin.begin(), by_image.begin.end() - 1);
  by_image.observation.resize(view.observations.size());
  by_image.rank.resize(view.observations.size());
  for (std::size_t k = 0; k < view.observations.size(); ++k) {
    const auto image = static_cast<std::size_t>(view.image_of(view.observations[k]));
    by_image.rank[k] = next[image] - by_image.begin[image];
    by_image.observation[static_cast<std::size_t>(next[image]++)] = static_cast<std::int64_t>(k);
  }
  return by_image;
}

std::vector<std::int64_t> track_of_observation(const ExportView& view) {
  std::vector<std::int64_t> track(view.observations.size());
  for (std::size_t t = 0; t + 1 < view.begin.size(); ++t)
    for (std::int64_t k = view.begin[t]; k < view.begin[t + 1]; ++k)
      track[static_cast<std::size_t>(k)] = static_cast<std::int64_t>(t);
  return track;
}

}  // namespace megablock
