// A query for images reads the index by image, then the column of images in the track files of the tiles that it names.
// A query for a place goes down three levels: districts (65536 points), runs (1024 points), points. Boxes bound the
// points of the level below, so nothing is missed, and rows of the file are read only if their box touches the place.
#include "io/result/measurements.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "io/base/error.h"
#include "io/result/measurement_index.h"
#include "io/store/units/track_reader.h"

namespace megablock {

namespace {

constexpr std::int64_t kGap = 4096;  // rows that are closer than this mostly lie in one chunk and are read together

// Picks the values of some rows from `values`, which has the rows in `ranges`.
template <typename T>
std::vector<T> picked(const std::vector<T>& values, const std::vector<RowRange>& ranges,
                      const std::vector<std::int64_t>& rows) {
  std::vector<T> found;
  found.reserve(rows.size());
  std::size_t range = 0;
  std::int64_t before = 0;  // number of rows in earlier ranges
  for (const std::int64_t row : rows) {
    while (row >= ranges[range].first + ranges[range].count) before += ranges[range++].count;
    found.push_back(values[static_cast<std::size_t>(before + row - ranges[range].first)]);
  }
  return found;
}

template <typename T>
std::vector<T> values_at(const Hdf5Reader& file, const std::string& name, const std::vector<std::int64_t>& rows) {
  const std::vector<RowRange> ranges = ranges_of(rows, kGap);
  return picked(file.rows<T>(name, ranges), ranges, rows);
}

template <typename T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

void append_tile(Measurements& all, const std::string& path, TileIndex tile, const std::vector<ImageIndex>& images) {
  const TrackReader reader(path);
  const TrackReader::Found found = reader.find(images);
  const std::vector<RowRange> ranges = ranges_of(found.row, kGap);
  const TrackReader::Measured measured = reader.measured(ranges);
  append(all.image, found.image);
  append(all.track, found.track);
  append(all.x, picked(measured.x, ranges, found.row));
  append(all.y, picked(measured.y, ranges, found.row));
  append(all.feature, picked(measured.feature, ranges, found.row));
  all.tile.resize(all.image.size(), tile);
}

template <typename T>
void reorder(std::vector<T>& values, const std::vector<std::size_t>& order) {
  std::vector<T> ordered;
  ordered.reserve(order.size());
  for (const std::size_t row : order) ordered.push_back(values[row]);
  values = std::move(ordered);
}

void sort_by_image(Measurements& all) {
  std::vector<std::size_t> order(all.image.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return all.image[a] < all.image[b]; });
  reorder(all.image, order);
  reorder(all.track, order);
  reorder(all.x, order);
  reorder(all.y, order);
  reorder(all.feature, order);
  reorder(all.tile, order);
}

// Finds the rows of names in a dataset of texts; -1 for a missing name. The dataset is read in portions.
std::vector<std::int64_t> find_texts(const Hdf5Reader& file, const std::string& name,
                                     const std::vector<std::string>& wanted) {
  constexpr std::int64_t kPortion = 1 << 16;
  std::vector<std::int64_t> found(wanted.size(), -1);
  const std::int64_t count = file.shape(name).front();
  for (std::int64_t first = 0; first < count; first += kPortion) {
    const std::vector<std::string> texts = file.text_rows(name, {{first, std::min(kPortion, count - first)}});
    for (std::size_t w = 0; w < wanted.size(); ++w)
      if (const auto at = std::find(texts.begin(), texts.end(), wanted[w]); found[w] < 0 && at != texts.end())
        found[w] = first + (at - texts.begin());
    if (std::find(found.begin(), found.end(), -1) == found.end()) break;
  }
  return found;
}

// Distance of a box from a place: that of its nearest point. A point is a box without extent.
double distance_from(const GroundPlace& place, const Eigen::Vector3d& lowest, const Eigen::Vector3d& highest) {
  // The nearest point of the box is the place, clamped to the box.
  Eigen::Vector3d offset = (place.centre.cwiseMax(lowest).cwiseMin(highest)) - place.centre;
  if (std::isnan(place.centre.z())) offset.z() = 0;
  return offset.norm();
}

// Finds the boxes that touch the place. Each box stands for `members` rows of the next lower level, which has `count`
// rows; the result has these rows.
std::vector<RowRange> rows_touched(const std::vector<float>& boxes, const std::vector<RowRange>& ranges,
                                   const GroundPlace& place, std::int64_t members, std::int64_t count) {
  std::vector<RowRange> touched;
  const float* box = boxes.data();
  for (const RowRange& range : ranges)
    for (std::int64_t row = range.first; row < range.first + range.count; ++row, box += 6) {
      if (std::isnan(box[0])) continue;  // the box has no point with a position
      const Eigen::Vector3d lowest(box[0], box[1], box[2]), highest(box[3], box[4], box[5]);
      if (distance_from(place, lowest, highest) <= place.radius_m)
        touched.push_back({row * members, std::min(members, count - row * members)});
    }
  return touched;
}

}  // namespace

MeasurementStore::MeasurementStore(const std::string& job) : store_(job) {
  if (!std::filesystem::exists(store_.path("job.json")))
    throw InputError(job + ": is not a job directory (it has no job.json); name the folder given to 'run -j'");
}

std::vector<ImageIndex> MeasurementStore::find_images(const std::vector<std::string>& names) const {
  const Hdf5Reader block(store_.verified_path("block.h5"), "block");
  std::vector<ImageIndex> images;
  for (const std::int64_t row : find_texts(block, "images/name", names)) {
    if (row < 0)
      throw InputError(store_.directory() + ": the job has no image '" + names[images.size()] +
                       "'; give its path relative to the project's folder of images");
    images.emplace_back(row);
  }
  return images;
}

std::vector<ImageIndex> MeasurementStore::images_of_frames(const std::vector<std::string>& names) const {
  const Hdf5Reader block(store_.verified_path("block.h5"), "block");
  const std::vector<std::int64_t> frames = find_texts(block, "frames/name", names);
  for (std::size_t f = 0; f < frames.size(); ++f)
    if (frames[f] < 0)
      throw InputError(store_.directory() + ": the job has no frame '" + names[f] +
                       "'; 'export --format csv' lists the frames");
  const std::vector<std::int64_t> frame_of = block.vector<std::int64_t>("images/frame");
  std::vector<ImageIndex> images;
  for (std::size_t i = 0; i < frame_of.size(); ++i)
    if (std::find(frames.begin(), frames.end(), frame_of[i]) != frames.end())
      images.emplace_back(static_cast<std::int64_t>(i));
  return images;
}

std::vector<std::string> MeasurementStore::names_of(const std::vector<ImageIndex>& images) const {
  std::vector<std::int64_t> rows;
  for (const ImageIndex image : images) rows.push_back(image.value);
  const Hdf5Reader block(store_.verified_path("block.h5"), "block");
  const std::vector<RowRange> ranges = ranges_of(rows, kGap);
  return picked(block.text_rows("images/name", ranges), ranges, rows);
}

// The tiles that have observations in these images, ascending.
std::vector<TileIndex> MeasurementStore::tiles_of(const std::vector<ImageIndex>& images) const {
  if (!index_) {
    const auto tracks = store_.seal(kTrackList);
    if (!tracks) throw InputError(store_.directory() + ": the job has no tracks yet; run it as far as 'match'");
    if (!std::filesystem::exists(store_.path(kMeasurementIndex)))
      throw StoreError(store_.path(kMeasurementIndex) + ": is missing; run the job again to make it");
    const std::string path = store_.verified_path(kMeasurementIndex);
    if (!store_.up_to_date(kMeasurementIndex, measurement_index_fingerprint(*tracks)))
      throw StoreError(path + ": is older than the job's tracks; run the job again");
    index_ = std::make_unique<Hdf5Reader>(path, kMeasurementIndexKind);
  }
  const std::int64_t count = index_->shape(kImageBegin).front() - 1;
  std::vector<std::int64_t> rows;
  for (const ImageIndex image : images)
    if (image.value < count) rows.insert(rows.end(), {image.value, image.value + 1});
  const std::vector<std::int64_t> begin = values_at<std::int64_t>(*index_, kImageBegin, rows);
  rows.clear();
  for (std::size_t i = 0; i < begin.size(); i += 2)
    for (std::int64_t row = begin[i]; row < begin[i + 1]; ++row) rows.push_back(row);
  std::vector<TileIndex> tiles;
  for (const std::int64_t tile : values_at<std::int64_t>(*index_, kImageTile, rows)) tiles.emplace_back(tile);
  std::sort(tiles.begin(), tiles.end());
  tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
  return tiles;
}

Measurements MeasurementStore::of_images(std::vector<ImageIndex> images) const {
  std::sort(images.begin(), images.end());
  images.erase(std::unique(images.begin(), images.end()), images.end());
  if (!images.empty() && !images.front().valid()) throw InputError("an image without index has no measurements");
  Measurements all;
  for (const TileIndex tile : tiles_of(images)) {
    const std::string unit = tracks_unit(tile), path = store_.verified_path(unit);
    const auto expected = index_->rows<std::uint64_t>(kTileFingerprint, {{tile.value, 1}}).front();
    if (!store_.up_to_date(unit, expected))
      throw StoreError(path + ": is newer than " + kMeasurementIndex + "; run the job again");
    append_tile(all, path, tile, images);
  }
  sort_by_image(all);
  return all;
}

// The result is as large as the block, so its hash is not verified here. HDF5 checks each chunk that it reads.
const Hdf5Reader& MeasurementStore::result() const {
  if (result_) return *result_;
  if (!store_.seal(kResult))
    throw InputError(store_.directory() +
                     ": the job has no result yet, and only the result has the positions of points; run it to the end");
  auto file = std::make_unique<Hdf5Reader>(store_.path(kResult), "result");
  if (!file->has("points/district") || !file->has("points/track"))
    throw StoreError(store_.path(kResult) + ": has no index of places; delete it and run the job again");
  result_ = std::move(file);
  return *result_;
}

// The rows of the points of the result in a place, ascending.
std::vector<std::int64_t> MeasurementStore::points_near(const GroundPlace& place) const {
  const Hdf5Reader& file = result();
  const std::int64_t count = file.shape("points/id").front(), run_count = file.shape("points/box").front(),
                     district_count = file.shape("points/district").front();
  const std::vector<RowRange> all = {{0, district_count}};
  const std::vector<RowRange> districts =
      rows_touched(file.rows<float>("points/district", all), all, place, kDistrictRuns, run_count);
  const std::vector<RowRange> runs =
      rows_touched(file.rows<float>("points/box", districts), districts, place, kPointRun, count);
  const std::vector<double> positions = file.rows<double>("points/position", runs);
  std::vector<std::int64_t> points;
  const double* position = positions.data();
  for (const RowRange& run : runs)
    for (std::int64_t row = run.first; row < run.first + run.count; ++row, position += 3) {
      const Eigen::Vector3d point(position[0], position[1], position[2]);
      if (point.allFinite() && distance_from(place, point, point) <= place.radius_m) points.push_back(row);
    }
  return points;
}

Eigen::AlignedBox3d MeasurementStore::extent() const {
  Eigen::AlignedBox3d extent;
  const std::vector<float> districts =
      result().rows<float>("points/district", {{0, result().shape("points/district").front()}});
  for (auto box = districts.begin(); box != districts.end(); box += 6) {
    if (std::isnan(box[0])) continue;  // the box has no point with a position
    extent.extend(Eigen::Vector3d(box[0], box[1], box[2]));
    extent.extend(Eigen::Vector3d(box[3], box[4], box[5]));
  }
  return extent;
}

Measurements MeasurementStore::near(const GroundPlace& place) const {
  if (!place.centre.head<2>().allFinite() || !std::isfinite(place.radius_m) || place.radius_m < 0)
    throw InputError("east and north of a place must be finite numbers, and its radius at least 0 m");
  const std::vector<std::int64_t> points = points_near(place);
  const Hdf5Reader& file = result();
  std::vector<std::int64_t> rows;
  for (const std::int64_t point : points) rows.insert(rows.end(), {point, point + 1});
  const std::vector<std::int64_t> begin = values_at<std::int64_t>(file, "points/begin", rows);
  const std::vector<std::int64_t> track = values_at<std::int64_t>(file, "points/track", points);
  const std::vector<std::int64_t> tile = values_at<std::int64_t>(file, "points/tile", points);
  Measurements all;
  rows.clear();
  for (std::size_t p = 0; p < points.size(); ++p)
    for (std::int64_t row = begin[2 * p]; row < begin[2 * p + 1]; ++row) {
      rows.push_back(row);
      all.track.emplace_back(track[p]);
      all.tile.emplace_back(tile[p]);
    }
  for (const std::int64_t image : values_at<std::int64_t>(file, "observations/image", rows))
    all.image.emplace_back(image);
  all.x = values_at<std::int32_t>(file, "observations/x", rows);
  all.y = values_at<std::int32_t>(file, "observations/y", rows);
  all.feature = values_at<std::int32_t>(file, "observations/feature", rows);
  all.kept = values_at<std::uint8_t>(file, "observations/kept", rows);
  all.residual_x = values_at<float>(file, "observations/residual_x", rows);
  all.residual_y = values_at<float>(file, "observations/residual_y", rows);
  return all;
}

}  // namespace megablock
