#include "io/result/result.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "io/base/hash.h"
#include "io/block/camera_hash.h"
#include "io/block/track_rows.h"
#include "io/result/result_digest.h"
#include "io/result/track_batches.h"

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
  for (const Intrinsics& intrinsics : state.cameras) add_values_to_hash(hasher, intrinsics);
  hasher.add(state.mounts.size());
  for (const std::vector<Pose>& rig : state.mounts) {
    hasher.add(rig.size());
    for (const Pose& mount : rig) add_pose(hasher, mount);
  }
}

// Adds a point and its kept observations to the hash. A missing point is hashed as a mark, because NaN has many bit
// patterns.
void add_point(Hasher& hasher, const TrackResults& result, std::size_t row) {
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
  // x and y are the fixed-point integers of the files, so the hash sees exactly what is stored.
  hasher.add(observations);
}

}  // namespace

bool BlockResult::ControlResult::takes_part() const {
  for (std::size_t m = 0; m < residual_px.size(); ++m)
    if (takes_part(m)) return true;
  return false;
}

void TrackResults::append(const TrackResults& from, std::size_t first, std::size_t last) {
  const auto begin = static_cast<std::int64_t>(first), end = static_cast<std::int64_t>(last);
  const auto copy = [](const auto& source, std::int64_t row, std::int64_t behind, auto& target) {
    if (!source.empty()) append_rows(source, row, behind, target);  // the column is optional
  };
  append_tracks(from.tracks, begin, end, tracks);
  copy(from.points, begin, end, points);
  copy(from.file_tracks, begin, end, file_tracks);
  copy(from.file_tiles, begin, end, file_tiles);
  copy(from.point_covariance, begin, end, point_covariance);
  const std::int64_t row = from.tracks.begin[first], behind = from.tracks.begin[last];
  copy(from.kept, row, behind, kept);
  copy(from.residual_x, row, behind, residual_x);
  copy(from.residual_y, row, behind, residual_y);
  copy(from.redundancy_x, row, behind, redundancy_x);
  copy(from.redundancy_y, row, behind, redundancy_y);
}

void TrackResults::clear() {
  const auto clear = [](auto&... columns) { (columns.clear(), ...); };
  clear(tracks.id, tracks.begin, tracks.image, tracks.x, tracks.y, tracks.feature, points, file_tracks, file_tiles,
        point_covariance, kept, residual_x, residual_y, redundancy_x, redundancy_y);
}

void visit_sample(const TrackBatches& tracks, std::int64_t most,
                  const std::function<void(const TrackResults& batch, std::size_t row)>& visit) {
  const std::int64_t step = 1 + (tracks.track_count() - 1) / most;
  std::int64_t before = 0;  // number of tracks in earlier batches
  tracks.visit([&](const TrackResults& batch) {
    // The first row of this batch whose number in the whole result is a multiple of step.
    for (std::int64_t row = (step - before % step) % step; row < batch.tracks.track_count(); row += step)
      visit(batch, static_cast<std::size_t>(row));
    before += batch.tracks.track_count();
  });
}

TrackResults sample_of(const TrackBatches& tracks, std::int64_t most) {
  TrackResults sample;
  visit_sample(tracks, most, [&](const TrackResults& batch, std::size_t row) { sample.append(batch, row, row + 1); });
  return sample;
}

ResultDigest::ResultDigest(const BlockState& state, std::int64_t track_count) {
  add_state(hasher_, state);
  hasher_.add(static_cast<std::size_t>(track_count));
}

void ResultDigest::add(const TrackResults& batch) {
  for (std::size_t row = 0; row < batch.tracks.id.size(); ++row) add(batch, row);
}

void ResultDigest::add(const TrackResults& batch, std::size_t row) { add_point(hasher_, batch, row); }

std::string ResultDigest::text() const { return hex(hasher_.value()); }

std::string result_digest(const BlockResult& result) {
  std::vector<std::size_t> order(result.tracks.id.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return result.tracks.id[a] < result.tracks.id[b]; });
  ResultDigest digest(result.state, result.tracks.track_count());
  for (const std::size_t row : order) digest.add(result, row);
  return digest.text();
}

ReprojectionStatistics reprojection_statistics(const BlockResult& result) {
  return reprojection_statistics(result, WholeTracks(result));
}

ReprojectionStatistics reprojection_statistics(const BlockResult& result, const TrackBatches& tracks) {
  ReprojectionStatistics statistics;
  for (const Image& image : result.block.images)
    if (result.state.oriented[image.frame]) ++statistics.oriented_images;
  double sum = 0, sum_of_squares = 0;
  tracks.visit([&](const TrackResults& batch) {
    for (std::size_t p = 0; p < batch.points.size(); ++p) {
      if (!batch.points[p].allFinite()) continue;
      std::int64_t used = 0;
      for (std::int64_t o = batch.tracks.begin[p]; o < batch.tracks.begin[p + 1]; ++o) {
        const auto i = static_cast<std::size_t>(o);
        if (!batch.kept[i]) continue;
        const double x = batch.residual_x[i], y = batch.residual_y[i];
        if (std::isnan(x) || std::isnan(y)) continue;  // the image has no pose
        sum += std::hypot(x, y);
        sum_of_squares += x * x + y * y;
        ++used;
      }
      statistics.observations += used;
      if (used > 0) ++statistics.points;
    }
  });
  if (statistics.observations == 0) return statistics;
  const auto count = static_cast<double>(statistics.observations);
  statistics.mean_px = sum / count;
  statistics.rms_px = std::sqrt(sum_of_squares / count);
  statistics.mean_track_length = count / static_cast<double>(statistics.points);
  return statistics;
}

}  // namespace megablock
