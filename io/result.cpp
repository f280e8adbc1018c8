#include "io/result.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "io/hash.h"

namespace megablock {

namespace {

void add_pose(Hasher& hasher, const Pose& pose) {
  for (const double q : {pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()}) hasher.add(q);
  for (const double c : pose.centre) hasher.add(c);
}

void add_state(Hasher& hasher, const BlockState& state) {
  hasher.add(state.frames.size());
  for (FrameIndex f(0); state.frames.contains(f); ++f.value) {
    hasher.add(state.oriented[f]);
    if (state.oriented[f]) add_pose(hasher, state.frames[f]);
  }
  hasher.add(state.cameras.size());
  for (const Intrinsics& intrinsics : state.cameras)
    for (const double value : intrinsics) hasher.add(value);
  hasher.add(state.mounts.size());
  for (const std::vector<Pose>& rig : state.mounts) {
    hasher.add(rig.size());
    for (const Pose& mount : rig) add_pose(hasher, mount);
  }
}

// A point, or a mark for its absence (a NaN has many bit patterns), and its kept observations.
void add_point(Hasher& hasher, const BlockResult& result, std::size_t row) {
  const TrackSet& tracks = result.tracks;
  const Eigen::Vector3d& point = result.points[row];
  hasher.add(tracks.id[row].value);
  hasher.add(static_cast<std::uint8_t>(point.allFinite()));
  if (point.allFinite())
    for (const double c : point) hasher.add(c);
  std::vector<std::int64_t> observations;
  for (std::int64_t o = tracks.begin[row]; o < tracks.begin[row + 1]; ++o) {
    const auto i = static_cast<std::size_t>(o);
    if (result.kept[i]) observations.insert(observations.end(), {tracks.image[i].value, tracks.x[i], tracks.y[i]});
  }
  hasher.add(observations);
}

}  // namespace

std::string result_digest(const BlockResult& result) {
  Hasher hasher;
  add_state(hasher, result.state);
  std::vector<std::size_t> order(result.tracks.id.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return result.tracks.id[a] < result.tracks.id[b]; });
  hasher.add(order.size());
  for (const std::size_t row : order) add_point(hasher, result, row);
  return hex(hasher.value());
}

ReprojectionStatistics reprojection_statistics(const BlockResult& result) {
  ReprojectionStatistics statistics;
  for (const Image& image : result.block.images)
    if (result.state.oriented[image.frame]) ++statistics.oriented_images;
  double sum = 0, sum_of_squares = 0;
  for (std::size_t p = 0; p < result.points.size(); ++p) {
    if (!result.points[p].allFinite()) continue;
    std::int64_t used = 0;
    for (std::int64_t o = result.tracks.begin[p]; o < result.tracks.begin[p + 1]; ++o) {
      const auto i = static_cast<std::size_t>(o);
      if (!result.kept[i]) continue;
      const double x = result.residual_x[i], y = result.residual_y[i];
      if (std::isnan(x) || std::isnan(y)) continue;  // of an image without pose
      sum += std::hypot(x, y);
      sum_of_squares += x * x + y * y;
      ++used;
    }
    statistics.observations += used;
    if (used > 0) ++statistics.points;
  }
  if (statistics.observations == 0) return statistics;
  const auto count = static_cast<double>(statistics.observations);
  statistics.mean_px = sum / count;
  statistics.rms_px = std::sqrt(sum_of_squares / count);
  statistics.mean_track_length = count / static_cast<double>(statistics.points);
  return statistics;
}

}  // namespace megablock
