#include "cluster/stages/assemble_result.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "cluster/matrix_bytes.h"
#include "cluster/stages/provenance.h"
#include "geometry/camera.h"
#include "geometry/pose.h"

namespace megablock {

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Adjusted minus measured; NaN where there is no point or it lies behind the camera.
Eigen::Vector2d residual(const MergeTile& tile, std::int64_t point, std::int64_t o) {
  const Eigen::Vector2d undefined = Eigen::Vector2d::Constant(kNaN);
  const Eigen::Vector3d& ground = tile.state.points[static_cast<std::size_t>(point)];
  const LocalImage local = tile.problem.image[static_cast<std::size_t>(o)];
  if (!local.valid() || !ground.allFinite()) return undefined;
  const TileImage& image = tile.problem.images[static_cast<std::size_t>(local.value)];
  const Eigen::Vector3d x = to_camera(tile.state.frames[static_cast<std::size_t>(image.frame.value)],
                                      tile.state.mounts[static_cast<std::size_t>(image.mount)], ground);
  return reprojection(tile.state.cameras[static_cast<std::size_t>(image.camera.value)], x,
                      {tile.problem.x[static_cast<std::size_t>(o)], tile.problem.y[static_cast<std::size_t>(o)]});
}

// Rows of all tiles' tracks in the order of their keys.
struct TrackRow {
  TrackIndex key;
  std::size_t part;
  std::int64_t row;
};

std::vector<TrackRow> ordered_tracks(const std::vector<TileResult>& parts) {
  std::vector<TrackRow> rows;
  for (std::size_t p = 0; p < parts.size(); ++p)
    for (std::int64_t t = 0; t < parts[p].tracks.track_count(); ++t)
      rows.push_back({parts[p].tracks.id[static_cast<std::size_t>(t)], p, t});
  // Parts of one track have one key; they lie behind one another in one tile.
  std::stable_sort(rows.begin(), rows.end(), [](const TrackRow& a, const TrackRow& b) { return a.key < b.key; });
  return rows;
}

void append_tracks(BlockResult& result, const std::vector<TileResult>& parts) {
  result.tracks.begin.push_back(0);
  const bool covariances = std::all_of(
      parts.begin(), parts.end(), [](const TileResult& part) { return part.covariances.size() == part.points.size(); });
  std::int64_t dense = 0;
  for (const TrackRow& row : ordered_tracks(parts)) {
    const TileResult& part = parts[row.part];
    const auto t = static_cast<std::size_t>(row.row);
    result.tracks.id.push_back(TrackIndex(dense++));
    result.file_tracks.push_back(row.key);
    result.file_tiles.push_back(TileIndex(static_cast<std::int64_t>(row.part)));
    result.points.push_back(part.positions[t]);
    if (covariances) result.point_covariance.push_back(part.covariances[t]);
    for (std::int64_t i = part.tracks.begin[t]; i < part.tracks.begin[t + 1]; ++i) {
      const auto o = static_cast<std::size_t>(i);
      result.tracks.image.push_back(part.tracks.image[o]);
      result.tracks.x.push_back(part.tracks.x[o]);
      result.tracks.y.push_back(part.tracks.y[o]);
      result.tracks.feature.push_back(part.tracks.feature[o]);
      result.kept.push_back(part.kept[o]);
      result.residual_x.push_back(part.residual_x[o]);
      result.residual_y.push_back(part.residual_y[o]);
    }
    result.tracks.begin.push_back(static_cast<std::int64_t>(result.tracks.image.size()));
  }
}

void append_control(BlockResult& result, const std::vector<TileResult>& parts) {
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(kNaN);
  for (const ControlPoint& point : result.block.control_points)
    result.control.push_back({unknown, Eigen::Matrix3d::Constant(kNaN),
                              std::vector<Eigen::Vector2d>(point.measurements.size(), Eigen::Vector2d::Constant(kNaN)),
                              std::vector<std::uint8_t>(point.measurements.size(), 0)});
  for (const TileResult& part : parts) {
    for (std::size_t p = 0; p < part.points.size(); ++p) {
      if (part.points[p].role == PointRole::kTie) continue;
      auto& control = result.control[static_cast<std::size_t>(part.points[p].index)];
      control.adjusted = part.positions[p];
      if (p < part.covariances.size()) control.covariance = part.covariances[p];
      const std::size_t rows = static_cast<std::size_t>(part.begin[p + 1] - part.begin[p]);
      for (std::size_t m = 0; m < std::min(rows, control.residual_px.size()); ++m) {
        const auto o = static_cast<std::size_t>(part.begin[p]) + m;
        control.residual_px[m] = Eigen::Vector2d(part.residual_x[o], part.residual_y[o]);
        control.kept[m] = part.kept[o];
      }
    }
  }
}

void find_boundary(BlockResult& result, const std::vector<TileResult>& parts) {
  IndexedVector<FrameIndex, int> touched(result.block.frames.size(), 0);
  for (const TileResult& part : parts)
    for (const FrameIndex frame : part.frames) ++touched[frame];
  for (const int count : touched) result.boundary.push_back(count > 1 ? 1 : 0);
}

// Images without pose, each with its reason.
void list_failures(const Job& job, BlockResult& result) {
  result.failures = job.failures;
  for (std::size_t i = 0; i < job.block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const FrameIndex frame = job.block.images[image].frame;
    if (result.state.oriented[frame]) continue;
    const auto known = std::find_if(job.failures.begin(), job.failures.end(), [&](const FailedUnit& failure) {
      return failure.unit == job.block.images[image].name;
    });
    if (known != job.failures.end()) continue;
    const auto reason = job.not_oriented.find(frame);
    const bool linked = result.tiles.tile_of_frame.contains(frame) && result.tiles.tile_of_frame[frame].valid();
    result.failures.push_back({linked ? "orientation" : "matching", job.block.images[image].name,
                               linked && reason != job.not_oriented.end() ? reason->second
                               : linked ? "oriented at first, but too few of its observations hold in the adjustment"
                                        : "no other image shares enough verified matches with it"});
  }
}

}  // namespace

std::string to_bytes(const TileResult& part) {
  ByteWriter writer;
  writer.values(part.tracks.id);
  writer.values(part.tracks.begin);
  writer.values(part.tracks.image);
  writer.values(part.tracks.x);
  writer.values(part.tracks.y);
  writer.values(part.tracks.feature);
  writer.values(part.points);
  write_matrices(writer, part.positions);
  write_matrices(writer, part.covariances);
  writer.values(part.kept);
  writer.values(part.residual_x);
  writer.values(part.residual_y);
  writer.values(part.begin);
  writer.values(part.frames);
  const Bytes bytes = writer.take();
  return {bytes.begin(), bytes.end()};
}

TileResult tile_result_from_bytes(const std::string& text) {
  const Bytes bytes(text.begin(), text.end());
  ByteReader reader(bytes);
  const auto read = [&](auto& values) {
    values = reader.values<typename std::decay_t<decltype(values)>::value_type>();
  };
  TileResult part;
  read(part.tracks.id);
  read(part.tracks.begin);
  read(part.tracks.image);
  read(part.tracks.x);
  read(part.tracks.y);
  read(part.tracks.feature);
  read(part.points);
  part.positions = read_matrices<Eigen::Vector3d>(reader);
  part.covariances = read_matrices<Eigen::Matrix3d>(reader);
  read(part.kept);
  read(part.residual_x);
  read(part.residual_y);
  read(part.begin);
  read(part.frames);
  return part;
}

TileResult make_tile_result(const MergeTile& tile, std::vector<Eigen::Matrix3d> covariances) {
  TileResult result;
  result.tracks = tile.tracks;
  result.points = tile.problem.points;
  result.positions = tile.state.points;
  result.covariances = std::move(covariances);
  result.kept = tile.problem.kept;
  result.begin = tile.problem.begin;
  for (std::int64_t p = 0; p < tile.problem.point_count(); ++p) {
    const auto row = static_cast<std::size_t>(p);
    for (std::int64_t o = tile.problem.begin[row]; o < tile.problem.begin[row + 1]; ++o) {
      const Eigen::Vector2d r = residual(tile, p, o);
      result.residual_x.push_back(static_cast<float>(r.x()));
      result.residual_y.push_back(static_cast<float>(r.y()));
    }
    if (tile.problem.active(p)) continue;  // takes no part: not an adjusted point
    for (std::int64_t o = tile.problem.begin[row]; o < tile.problem.begin[row + 1]; ++o)
      result.kept[static_cast<std::size_t>(o)] = 0;
  }
  // A frame is touched by observations that take part.
  for (std::size_t o = 0; o < result.kept.size(); ++o)
    if (result.kept[o])
      result.frames.push_back(tile.problem.frames[static_cast<std::size_t>(
          tile.problem.images[static_cast<std::size_t>(tile.problem.image[o].value)].frame.value)]);
  std::sort(result.frames.begin(), result.frames.end());
  result.frames.erase(std::unique(result.frames.begin(), result.frames.end()), result.frames.end());
  return result;
}

namespace {

void scale_covariances(BlockResult& result, double factor) {
  for (auto& covariance : result.frame_covariance) covariance *= factor;
  for (auto& covariance : result.camera_covariance) covariance *= factor;
  for (auto& covariance : result.point_covariance) covariance *= factor;
  for (auto& control : result.control) control.covariance *= factor;
  result.sigma_scaled = true;
}

}  // namespace

BlockResult assemble_result(const Job& job, const Tiles& tiles, const MergeOutcome& outcome,
                            const std::vector<TileResult>& parts) {
  BlockResult result;
  result.block = job.block;
  result.state = outcome.state;
  result.tiles = tiles;
  result.frame_covariance = outcome.frame_covariance;
  result.camera_covariance = outcome.camera_covariance;
  append_tracks(result, parts);
  append_control(result, parts);
  find_boundary(result, parts);
  result.chi2 = outcome.chi2;
  result.degrees_of_freedom = outcome.degrees_of_freedom;
  result.variance_factor =
      outcome.degrees_of_freedom > 0 ? outcome.chi2 / static_cast<double>(outcome.degrees_of_freedom) : 1;
  if (job.settings.merge.scale_sigma) scale_covariances(result, result.variance_factor);
  result.image_sigma_px = outcome.image_sigma_px;
  result.global_iterations = outcome.global_iterations;
  result.newton_decrement = outcome.newton_decrement;
  result.decrement_limit = job.settings.merge.decrement;
  result.free_parts = outcome.free_parts;
  result.image_records = image_records(job);
  result.provenance = provenance_of(job);
  result.gauge = outcome.gauge;
  result.seams = outcome.seams;
  result.observation_table = outcome.observations;
  result.notes = job.notes;
  list_failures(job, result);
  result.digest = result_digest(result);
  return result;
}

}  // namespace megablock
