#include "cluster/stages/result/result_parts.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "cluster/mpi/matrix_bytes.h"
#include "geometry/camera/camera.h"
#include "geometry/transform/pose.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/block/track_rows.h"

namespace megablock {

namespace {

constexpr std::int64_t kPieceTracks = 64;       // read at a time from each tile, of which there may be thousands
constexpr std::int64_t kBatchTracks = 1 << 14;  // tracks in a batch
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Adjusted minus measured coordinates; NaN when there is no point or it lies behind the camera.
Eigen::Vector2d residual(const RankTile& tile, std::int64_t point, std::int64_t o) {
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

// Marks the kept observations of a tile. Those of points that take no part count as rejected.
std::vector<std::uint8_t> verdicts(const TileProblem& problem) {
  std::vector<std::uint8_t> kept = problem.kept;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (!problem.active(p))
      std::fill(kept.begin() + problem.begin[static_cast<std::size_t>(p)],
                kept.begin() + problem.begin[static_cast<std::size_t>(p) + 1], std::uint8_t{0});
  return kept;
}

void count_measurements(const TileProblem& problem, const std::vector<std::uint8_t>& kept, TilePart& part) {
  for (std::size_t p = 0; p < problem.points.size(); ++p) {
    if (problem.points[p].role != PointRole::kTie) continue;
    part.measured += problem.begin[p + 1] - problem.begin[p];
    part.kept += std::accumulate(kept.begin() + problem.begin[p], kept.begin() + problem.begin[p + 1], std::int64_t{0});
  }
}

// The redundancy in units of 1 / 255 (TrackResults). NaN stands for an observation that takes no part.
std::uint8_t stored_redundancy(float value) {
  return value > 0 ? static_cast<std::uint8_t>(std::lround(255 * std::min(value, 1.f))) : 0;
}

// Appends one of the tile's tracks to `to`. Its id becomes its key.
void append_track(const RankTile& tile, const TrackSet& tracks, const std::vector<std::uint8_t>& kept,
                  const TileCovariance& covariance, std::int64_t track, TrackResults& to) {
  const auto t = static_cast<std::size_t>(track);
  append_tracks(tracks, track, track + 1, to.tracks);
  to.file_tracks.push_back(tracks.id[t]);
  to.file_tiles.push_back(TileIndex(tile.tile));
  to.points.push_back(tile.state.points[t]);
  if (!covariance.points.empty()) to.point_covariance.push_back(covariance.points[t]);
  std::size_t row = to.kept.size();  // row of the observation in `to`
  for (std::int64_t observation = tracks.begin[t]; observation < tracks.begin[t + 1]; ++observation, ++row) {
    const auto o = static_cast<std::size_t>(observation);
    to.tracks.x[row] = to_fixed_pixel(tile.problem.x[o]);
    to.tracks.y[row] = to_fixed_pixel(tile.problem.y[o]);
    to.kept.push_back(kept[o]);
    if (!covariance.redundancy_x.empty()) {
      to.redundancy_x.push_back(stored_redundancy(covariance.redundancy_x[o]));
      to.redundancy_y.push_back(stored_redundancy(covariance.redundancy_y[o]));
    }
    const Eigen::Vector2d r = residual(tile, track, observation);
    to.residual_x.push_back(static_cast<float>(r.x()));
    to.residual_y.push_back(static_cast<float>(r.y()));
  }
}

void add_control(const RankTile& tile, const std::vector<std::uint8_t>& kept,
                 const std::vector<Eigen::Matrix3d>& covariances, TilePart& part) {
  for (std::int64_t p = 0; p < tile.problem.point_count(); ++p) {
    const auto row = static_cast<std::size_t>(p);
    if (tile.problem.points[row].role == PointRole::kTie) continue;
    std::vector<Eigen::Vector2d> measured;
    BlockResult::ControlResult control{tile.state.points[row], Eigen::Matrix3d::Constant(kNaN), {}, {}};
    if (row < covariances.size()) control.covariance = covariances[row];
    for (std::int64_t o = tile.problem.begin[row]; o < tile.problem.begin[row + 1]; ++o) {
      measured.emplace_back(tile.problem.x[static_cast<std::size_t>(o)], tile.problem.y[static_cast<std::size_t>(o)]);
      control.residual_px.push_back(residual(tile, p, o));
      control.kept.push_back(kept[static_cast<std::size_t>(o)]);
    }
    part.control_rows.push_back(tile.problem.points[row].index);
    part.control.push_back(std::move(control));
    part.control_measured.push_back(std::move(measured));
  }
}

std::vector<FrameIndex> touched_frames(const TileProblem& problem, const std::vector<std::uint8_t>& kept) {
  std::vector<std::uint8_t> touched(problem.frames.size(), 0);
  for (std::size_t o = 0; o < kept.size(); ++o)
    if (kept[o])
      touched[static_cast<std::size_t>(problem.images[static_cast<std::size_t>(problem.image[o].value)].frame.value)] =
          1;
  std::vector<FrameIndex> frames;
  for (std::size_t f = 0; f < touched.size(); ++f)
    if (touched[f]) frames.push_back(problem.frames[f]);
  return frames;
}

// Writes or reads the columns of tracks as bytes; both use this one list.
template <typename Tracks, typename Visit>
void visit_columns(Tracks& t, Visit&& visit) {
  visit(t.tracks.id);
  visit(t.tracks.begin);
  visit(t.tracks.image);
  visit(t.tracks.x);
  visit(t.tracks.y);
  visit(t.tracks.feature);
  visit(t.file_tracks);
  visit(t.file_tiles);
  visit(t.kept);
  visit(t.residual_x);
  visit(t.residual_y);
  visit(t.redundancy_x);
  visit(t.redundancy_y);
}

Bytes bytes_of(const TrackResults& tracks) {
  ByteWriter writer;
  visit_columns(tracks, [&](const auto& column) { writer.values(column); });
  write_matrices(writer, tracks.points);
  write_matrices(writer, tracks.point_covariance);
  return writer.take();
}

TrackResults tracks_of(const Bytes& bytes) {
  ByteReader reader(bytes);
  TrackResults tracks;
  visit_columns(tracks,
                [&](auto& column) { column = reader.values<typename std::decay_t<decltype(column)>::value_type>(); });
  tracks.points = read_matrices<Eigen::Vector3d>(reader);
  tracks.point_covariance = read_matrices<Eigen::Matrix3d>(reader);
  return tracks;
}

// The rows of the tracks, ascending by key. Parts of one track have the same key and keep their order.
std::vector<std::int64_t> key_order(const TrackSet& tracks) {
  std::vector<std::int64_t> order(tracks.id.size());
  std::iota(order.begin(), order.end(), std::int64_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) {
    return tracks.id[static_cast<std::size_t>(a)] < tracks.id[static_cast<std::size_t>(b)];
  });
  return order;
}

// Reads a part piece by piece. The file is only open while a piece is read, because there may be thousands of parts.
class PartCursor {
 public:
  explicit PartCursor(const PartTracks::File& file) : file_(file), left_(file.track_count) { next_piece(); }

  bool at_end() const { return row_ == piece_.tracks.id.size(); }
  TrackIndex key() const { return piece_.tracks.id[row_]; }
  // Moves the tracks up to this key (`with_key`), or before it, to the batch, as far as the present piece has them.
  void move_to(TrackIndex key, bool with_key, TrackResults& batch) {
    const std::vector<TrackIndex>& id = piece_.tracks.id;
    const auto from = id.begin() + static_cast<std::ptrdiff_t>(row_);
    const auto to = with_key ? std::upper_bound(from, id.end(), key) : std::lower_bound(from, id.end(), key);
    const auto last = static_cast<std::size_t>(to - id.begin());
    batch.append(piece_, row_, last);
    row_ = last;
    if (row_ == id.size()) next_piece();
  }

 private:
  void next_piece() {
    if (left_ == 0) return;
    std::ifstream in(file_.path, std::ios::binary);
    in.seekg(offset_);
    std::uint64_t length = 0;
    in.read(reinterpret_cast<char*>(&length), sizeof length);
    Bytes bytes(in ? length : 0, '\0');
    if (!in.read(bytes.data(), static_cast<std::streamsize>(bytes.size())))
      throw StoreError("cannot read " + file_.path + "; run again to resume");
    offset_ += static_cast<std::streamoff>(sizeof length + length);
    piece_ = tracks_of(bytes);
    left_ -= piece_.tracks.track_count();
    row_ = 0;
  }

  const PartTracks::File& file_;
  std::int64_t left_;  // number of tracks in further pieces
  std::streamoff offset_ = 0;
  TrackResults piece_;
  std::size_t row_ = 0;
};

}  // namespace

Bytes TilePart::to_bytes() const {
  ByteWriter writer;
  writer.value(tile);
  writer.value(track_count);
  writer.value(measured);
  writer.value(kept);
  writer.values(frames);
  writer.values(control_rows);
  for (const BlockResult::ControlResult& point : control) {
    write_matrices<Eigen::Vector3d>(writer, {point.adjusted});
    write_matrices<Eigen::Matrix3d>(writer, {point.covariance});
    write_matrices(writer, point.residual_px);
    writer.values(point.kept);
  }
  for (const std::vector<Eigen::Vector2d>& positions : control_measured) write_matrices(writer, positions);
  writer.value(component);
  writer.values(motion.to_values());
  return writer.take();
}

TilePart TilePart::from_bytes(const Bytes& bytes) {
  ByteReader reader(bytes);
  TilePart part;
  part.tile = reader.value<std::int64_t>();
  part.track_count = reader.value<std::int64_t>();
  part.measured = reader.value<std::int64_t>();
  part.kept = reader.value<std::int64_t>();
  part.frames = reader.values<FrameIndex>();
  part.control_rows = reader.values<std::int64_t>();
  for (std::size_t i = 0; i < part.control_rows.size(); ++i) {
    BlockResult::ControlResult point;
    point.adjusted = read_matrices<Eigen::Vector3d>(reader).at(0);
    point.covariance = read_matrices<Eigen::Matrix3d>(reader).at(0);
    point.residual_px = read_matrices<Eigen::Vector2d>(reader);
    point.kept = reader.values<std::uint8_t>();
    part.control.push_back(std::move(point));
  }
  for (std::size_t i = 0; i < part.control_rows.size(); ++i)
    part.control_measured.push_back(read_matrices<Eigen::Vector2d>(reader));
  part.component = reader.value<std::int32_t>();
  part.motion = CommonMotion::from_values(reader.values<double>());
  return part;
}

TilePart write_part(const std::string& path, const RankTile& tile, const TrackSet& tracks,
                    const TileCovariance& covariance) {
  const std::vector<std::uint8_t> kept = verdicts(tile.problem);
  TilePart part;
  part.tile = tile.tile;
  part.track_count = tracks.track_count();
  count_measurements(tile.problem, kept, part);
  part.frames = touched_frames(tile.problem, kept);
  add_control(tile, kept, covariance.points, part);

  const std::vector<std::int64_t> order = key_order(tracks);
  errno = 0;
  std::ofstream file(path, std::ios::binary);
  for (std::int64_t first = 0; first < part.track_count; first += kPieceTracks) {
    TrackResults piece;
    for (std::int64_t i = first; i < std::min(first + kPieceTracks, part.track_count); ++i)
      append_track(tile, tracks, kept, covariance, order[static_cast<std::size_t>(i)], piece);
    const Bytes bytes = bytes_of(piece);
    const auto length = static_cast<std::uint64_t>(bytes.size());
    file.write(reinterpret_cast<const char*>(&length), sizeof length);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  file.close();
  if (!file) throw_file_error(path, "written", errno);
  return part;
}

PartTracks::PartTracks(std::vector<File> files, double covariance_factor, std::function<void()> after_batch)
    : files_(std::move(files)), covariance_factor_(covariance_factor), after_batch_(std::move(after_batch)) {
  for (const File& file : files_) count_ += file.track_count;
}

void PartTracks::visit(const Visit& visit) const {
  std::vector<PartCursor> parts(files_.begin(), files_.end());
  using Next = std::pair<TrackIndex, std::size_t>;  // key, part
  std::priority_queue<Next, std::vector<Next>, std::greater<>> order;
  for (std::size_t p = 0; p < parts.size(); ++p)
    if (!parts[p].at_end()) order.emplace(parts[p].key(), p);
  std::int64_t dense = 0;
  TrackResults batch;
  const auto hand_on = [&] {
    for (TrackIndex& id : batch.tracks.id) id = TrackIndex(dense++);
    for (Eigen::Matrix3d& covariance : batch.point_covariance) covariance *= covariance_factor_;
    visit(batch);
    batch.clear();
    if (after_batch_) after_batch_();
  };
  while (!order.empty()) {
    const std::size_t p = order.top().second;
    order.pop();
    // Of two parts with tracks of the same key, that with the lower number comes first.
    const Next end =
        order.empty() ? Next(TrackIndex(std::numeric_limits<std::int64_t>::max()), parts.size()) : order.top();
    parts[p].move_to(end.first, p < end.second, batch);
    if (!parts[p].at_end()) order.emplace(parts[p].key(), p);
    if (batch.tracks.track_count() >= kBatchTracks) hand_on();
  }
  if (!batch.tracks.id.empty()) hand_on();
}

}  // namespace megablock
