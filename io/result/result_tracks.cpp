#include "io/result/result_tracks.h"

#include <algorithm>
#include <utility>

#include "io/base/error.h"
#include "io/result/measurements.h"
#include "io/result/track_batches.h"
#include "io/store/hdf5/hdf5_matrices.h"
#include "io/store/hdf5/hdf5_tables.h"

namespace megablock {

namespace {

constexpr auto narrow = [](auto index) { return static_cast<std::int32_t>(index.value); };

void check_track_sizes(const TrackResults& result) {
  const std::size_t tracks = result.tracks.id.size(), observations = result.tracks.image.size();
  require_size(result.points.size(), tracks, "points");
  require_size(result.kept.size(), observations, "verdicts on observations");
  require_size(result.residual_x.size(), observations, "residuals");
  require_size(result.residual_y.size(), observations, "residuals");
  if (!result.point_covariance.empty()) require_size(result.point_covariance.size(), tracks, "point covariances");
  require_size(result.redundancy_y.size(), result.redundancy_x.size(), "redundancy numbers");
  if (!result.redundancy_x.empty()) require_size(result.redundancy_x.size(), observations, "redundancy numbers");
  require_size(result.file_tiles.size(), result.file_tracks.size(), "tiles of tracks");
  if (!result.file_tracks.empty()) require_size(result.file_tracks.size(), tracks, "indices of tracks in their tiles");
}

}  // namespace

void require_size(std::size_t found, std::size_t expected, const char* what) {
  if (found != expected)
    throw ComputeError("the result has " + std::to_string(found) + " " + what + ", expected " +
                       std::to_string(expected));
}

ResultTrackWriter::ResultTrackWriter(Hdf5Writer& file) : file_(file) {
  file.group("points", "one row per track in global order");
  file.growing<std::int64_t>("points/id", {}, {"", "global index"});
  file.growing<std::int64_t>("points/begin", {},
                             {"", "observations of point i are rows begin[i] to begin[i + 1] (exclusive)"});
  file.append("points/begin", std::vector<std::int64_t>{0});
  file.growing<double>("points/position", {3}, {"m", "ground frame; NaN: not triangulated"});
  file.group("observations", "one row per image measurement, in the order of the points");
  file.growing<std::int32_t>("observations/image", {}, {"", "row in images"});
  file.growing<std::int32_t>("observations/x", {}, {"2^-10 px", "to the right, pixel centres at +0.5"});
  file.growing<std::int32_t>("observations/y", {}, {"2^-10 px", "down, pixel centres at +0.5"});
  file.growing<std::int32_t>("observations/feature", {}, {"", "row in the image's features, -1: none"});
  file.growing<std::uint8_t>("observations/kept", {}, {"", "1: kept, 0: rejected"});
  file.growing<float>("observations/residual_x", {}, {"px", "adjusted minus measured"});
  file.growing<float>("observations/residual_y", {}, {"px", "adjusted minus measured"});
}

void ResultTrackWriter::append(const TrackResults& batch) {
  check_track_sizes(batch);
  if (batch.points.empty()) return;
  if (first_) add_optional_columns(batch);
  first_ = false;
  const TrackSet& tracks = batch.tracks;
  file_.append("points/id", plain(tracks.id));
  std::vector<std::int64_t> begin(tracks.begin.begin() + 1, tracks.begin.end());
  // The offsets of a batch begin at 0, those of the file go on.
  for (std::int64_t& row : begin) row += observations_;
  observations_ += tracks.observation_count();
  file_.append("points/begin", begin);
  file_.append("points/position", vectors3(batch.points, [](const Eigen::Vector3d& p) { return p; }));
  add_boxes(batch.points);
  if (!batch.file_tracks.empty()) {
    file_.append("points/track", plain(batch.file_tracks));
    file_.append("points/tile", column(batch.file_tiles, narrow));
  }
  if (!batch.point_covariance.empty()) file_.append("points/covariance", flattened<float>(batch.point_covariance));
  file_.append("observations/image", column(tracks.image, narrow));
  file_.append("observations/x", tracks.x);
  file_.append("observations/y", tracks.y);
  file_.append("observations/feature", tracks.feature);
  file_.append("observations/kept", batch.kept);
  file_.append("observations/residual_x", batch.residual_x);
  file_.append("observations/residual_y", batch.residual_y);
  if (!batch.redundancy_x.empty()) {
    file_.append("observations/redundancy_x", batch.redundancy_x);
    file_.append("observations/redundancy_y", batch.redundancy_y);
  }
}

void ResultTrackWriter::finish() {
  add_boxes({}, true);
  file_.matrix(
      "points/box", boxes_, 6,
      {"m", "bounds of each 1024 successive points: lowest east, north, up, highest; NaN: none has a position"});
  file_.matrix("points/district", districts_of(boxes_), 6, {"m", "the same of each 65536 successive points"});
  file_.attribute("observations", "observations_complete", std::uint8_t{1});
}

void ResultTrackWriter::add_optional_columns(const TrackResults& batch) {
  if (!batch.file_tracks.empty()) {
    file_.growing<std::int64_t>("points/track", {}, {"", "index of the track in the file of its tile"});
    file_.growing<std::int32_t>("points/tile", {}, {"", "that owns the track"});
  }
  if (!batch.redundancy_x.empty())
    for (const char* name : {"observations/redundancy_x", "observations/redundancy_y"})
      file_.growing<std::uint8_t>(name, {}, {"1/255", "redundancy number, 0 to 1; 0 as well: takes no part"});
  if (!batch.point_covariance.empty()) file_.growing<float>("points/covariance", {3, 3}, {"m^2", "posterior"});
}

// Adds the boxes of further points. Only full boxes are made, except for the last one.
void ResultTrackWriter::add_boxes(const std::vector<Eigen::Vector3d>& more, bool last) {
  waiting_.insert(waiting_.end(), more.begin(), more.end());
  const std::size_t whole =
      last ? waiting_.size() : waiting_.size() - waiting_.size() % static_cast<std::size_t>(kPointRun);
  const std::vector<float> boxes = boxes_of({waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(whole)});
  boxes_.insert(boxes_.end(), boxes.begin(), boxes.end());
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(whole));
}

TrackResults read_result_tracks(const Hdf5Reader& file, const RowRange& rows_of_points) {
  TrackResults result;
  TrackSet& tracks = result.tracks;
  const std::int64_t count = rows_of_points.count;
  const std::vector<RowRange> points = {rows_of_points};
  tracks.id = indices<TrackIndex>(file.rows<std::int64_t>("points/id", points));
  tracks.begin = file.rows<std::int64_t>("points/begin", {{rows_of_points.first, count + 1}});
  const std::int64_t first = tracks.begin.front();
  for (std::int64_t& row : tracks.begin) row -= first;
  const std::int64_t total = file.shape("observations/image").front();
  // Checks that the offsets ascend, before they are used.
  begin_of(file, "points/begin", counts_of(tracks.begin));
  if (first < 0 || first + tracks.begin.back() > total)
    file.fail("points/begin", "names rows that are not there: there are " + std::to_string(total) + " observations");
  const std::vector<RowRange> observations = {{first, tracks.begin.back()}};
  tracks.image = indices<ImageIndex>(file.rows<std::int64_t>("observations/image", observations));
  tracks.x = file.rows<std::int32_t>("observations/x", observations);
  tracks.y = file.rows<std::int32_t>("observations/y", observations);
  tracks.feature = file.rows<std::int32_t>("observations/feature", observations);
  result.kept = file.rows<std::uint8_t>("observations/kept", observations);
  result.residual_x = file.rows<float>("observations/residual_x", observations);
  result.residual_y = file.rows<float>("observations/residual_y", observations);
  if (file.has("observations/redundancy_x")) {
    result.redundancy_x = file.rows<std::uint8_t>("observations/redundancy_x", observations);
    result.redundancy_y = file.rows<std::uint8_t>("observations/redundancy_y", observations);
  }
  const auto positions = file.rows<double>("points/position", points);
  for (std::size_t p = 0; p < tracks.id.size(); ++p) result.points.push_back(vector3(positions, p));
  if (file.has("points/track")) {
    result.file_tracks = indices<TrackIndex>(file.rows<std::int64_t>("points/track", points));
    result.file_tiles = indices<TileIndex>(file.rows<std::int64_t>("points/tile", points));
  }
  if (file.has("points/covariance"))
    result.point_covariance = square_matrices<Eigen::Matrix3d>(file.rows<float>("points/covariance", points));
  return result;
}

std::int64_t count_result_tracks(const Hdf5Reader& file) {
  if (file.attribute<std::uint8_t>("observations", "observations_complete") != 1)
    file.fail("observations", "is not complete: a file of observations was missing when it was written");
  const auto require = [&](const std::string& name, const std::vector<std::int64_t>& shape) {
    const std::vector<std::int64_t> found = file.shape(name);
    if (found != shape)
      file.fail(name, "has " + std::to_string(found.empty() ? 0 : found[0]) + " rows, expected " +
                          std::to_string(shape[0]) + ", or rows of another width");
  };
  const auto rows_of = [&](const char* name) {
    const std::vector<std::int64_t> shape = file.shape(name);
    if (shape.size() != 1) file.fail(name, "is not a list");
    return shape[0];
  };
  const std::int64_t count = rows_of("points/id"), observations = rows_of("observations/image");
  require("points/begin", {count + 1});
  require("points/position", {count, 3});
  for (const char* name : {"points/track", "points/tile"})
    if (file.has(name)) require(name, {count});
  if (file.has("points/covariance")) require("points/covariance", {count, 3, 3});
  for (const char* name : {"x", "y", "feature", "kept", "residual_x", "residual_y"})
    require(std::string("observations/") + name, {observations});
  if (file.has("observations/redundancy_x"))
    for (const char* name : {"observations/redundancy_x", "observations/redundancy_y"}) require(name, {observations});
  if (file.rows<std::int64_t>("points/begin", {{count, 1}}).front() != observations)
    file.fail("points/begin", "does not end with the number of observations, " + std::to_string(observations));
  return count;
}

StoredTracks::StoredTracks(std::string path)
    : path_(std::move(path)), count_(count_result_tracks(Hdf5Reader(path_, "result"))) {}

void StoredTracks::visit(const Visit& visit) const {
  constexpr std::int64_t kBatch = 1 << 14;  // tracks
  const Hdf5Reader file(path_, "result");
  for (std::int64_t first = 0; first < count_; first += kBatch)
    visit(read_result_tracks(file, {first, std::min(kBatch, count_ - first)}));
}

}  // namespace megablock
