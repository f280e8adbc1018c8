// Makes the two indices of the measurement store: measurements.h5 (by image) and points/box of the result (by place).
#include "io/result/measurement_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/project/append.h"
#include "io/result/measurements.h"
#include "io/store/units/track_reader.h"

namespace megablock {

namespace {

// A change of the algorithm changes the fingerprint, so that old indices are made anew.
constexpr int kAlgorithm = 1;

std::vector<ImageIndex> distinct_images(const TrackSet& tracks) {
  std::vector<bool> seen;
  for (const ImageIndex image : tracks.image) {
    const auto row = static_cast<std::size_t>(image.value);
    if (row >= seen.size()) seen.resize(std::max(row + 1, 2 * seen.size()));
    seen[row] = true;
  }
  std::vector<ImageIndex> images;
  for (std::size_t i = 0; i < seen.size(); ++i)
    if (seen[i]) images.emplace_back(static_cast<std::int64_t>(i));
  return images;
}

void write_index(const std::string& path, const JobStore& store, const std::vector<std::string>& tiles) {
  std::vector<std::uint64_t> fingerprints;
  std::vector<std::vector<ImageIndex>> images;  // [tiles]
  std::size_t count = 0;
  for (const std::string& tile : tiles) {
    images.push_back(distinct_images(TrackReader(store.verified_path(tile)).images()));
    fingerprints.push_back(store.seal(tile)->fingerprint);
    if (!images.back().empty()) count = std::max(count, static_cast<std::size_t>(images.back().back().value) + 1);
  }
  std::vector<std::int64_t> begin(count + 1, 0);
  for (const auto& own : images)
    for (const ImageIndex image : own) ++begin[static_cast<std::size_t>(image.value) + 1];
  for (std::size_t i = 0; i < count; ++i) begin[i + 1] += begin[i];
  // Counting sort. Tiles come in order, so those of an image ascend.
  std::vector<std::int64_t> next(begin.begin(), begin.end() - 1), tile_of_row(static_cast<std::size_t>(begin.back()));
  for (std::size_t t = 0; t < images.size(); ++t)
    for (const ImageIndex image : images[t])
      tile_of_row[static_cast<std::size_t>(next[static_cast<std::size_t>(image.value)]++)] =
          static_cast<std::int64_t>(t);
  Hdf5Writer file(path, kMeasurementIndexKind);
  file.group("tiles", "with a file of tracks, in order");
  file.vector(kTileFingerprint, fingerprints, {"", "of the tile's file of tracks"});
  file.group("images", "tiles in which images have measurements; none behind the last row");
  file.vector(kImageBegin, begin, {"", "tiles of image i: rows begin[i] to begin[i + 1] (exclusive) of images/tile"});
  file.integers(kImageTile, tile_of_row, {"", "ascending for each image"});
  file.close();
}

}  // namespace

std::string tracks_unit(TileIndex tile) {
  char name[40];
  std::snprintf(name, sizeof name, "tracks/%06lld.h5", static_cast<long long>(tile.value));
  return name;
}

std::uint64_t measurement_index_fingerprint(const UnitSeal& tracks) {
  Hasher hasher;
  return hasher.add(kAlgorithm).add(tracks.content_hash).value();
}

std::string update_measurement_index(const JobStore& store, const std::vector<std::string>& tiles) {
  const auto tracks = store.seal(kTrackList);
  if (!tracks) throw StoreError(store.path(kTrackList) + ": is missing or damaged; run the job again");
  const std::uint64_t fingerprint = measurement_index_fingerprint(*tracks);
  std::string damage;
  if (!store.is_current(kMeasurementIndex, fingerprint, damage))
    store.write(kMeasurementIndex, fingerprint, [&](const std::string& path) { write_index(path, store, tiles); });
  return damage;
}

void check_measurement_index(const JobStore& store) {
  const std::string path = store.verified_path(kMeasurementIndex);
  const auto tracks = store.seal(kTrackList);
  bool current = tracks && store.up_to_date(kMeasurementIndex, measurement_index_fingerprint(*tracks));
  const auto fingerprints = Hdf5Reader(path, kMeasurementIndexKind).vector<std::uint64_t>(kTileFingerprint);
  for (std::size_t t = 0; current && t < fingerprints.size(); ++t)
    current = store.up_to_date(tracks_unit(TileIndex(static_cast<std::int64_t>(t))), fingerprints[t]);
  if (!current) throw StoreError(path + ": does not belong to the present tracks of the job; run the job again");
}

namespace {

constexpr float kBeyond = std::numeric_limits<float>::infinity(), kUnset = std::numeric_limits<float>::quiet_NaN();

struct Bounds {
  std::array<float, 3> lowest = {kUnset, kUnset, kUnset}, highest = {kUnset, kUnset, kUnset};

  // Extends the box; fmin and fmax ignore NaN.
  void add(const float* low, const float* high) {
    for (std::size_t k = 0; k < 3; ++k) {
      lowest[k] = std::fmin(lowest[k], low[k]);
      highest[k] = std::fmax(highest[k], high[k]);
    }
  }
  void append_to(std::vector<float>& boxes) const {
    boxes.insert(boxes.end(), lowest.begin(), lowest.end());
    boxes.insert(boxes.end(), highest.begin(), highest.end());
  }
};

}  // namespace

std::vector<float> boxes_of(const std::vector<Eigen::Vector3d>& points) {
  std::vector<float> boxes;
  for (std::size_t first = 0; first < points.size(); first += kPointRun) {
    Bounds box;
    for (std::size_t row = first; row < std::min<std::size_t>(points.size(), first + kPointRun); ++row) {
      if (!points[row].allFinite()) continue;
      const Eigen::Vector3f point = points[row].cast<float>();
      // The conversion to float may round either way by half a unit. One unit more to each side bounds the double.
      const Eigen::Vector3f low = point.unaryExpr([](float v) { return std::nextafter(v, -kBeyond); });
      const Eigen::Vector3f high = point.unaryExpr([](float v) { return std::nextafter(v, kBeyond); });
      box.add(low.data(), high.data());
    }
    box.append_to(boxes);
  }
  return boxes;
}

std::vector<float> districts_of(const std::vector<float>& boxes) {
  constexpr std::size_t kValues = 6 * kDistrictRuns;
  std::vector<float> districts;
  for (std::size_t first = 0; first < boxes.size(); first += kValues) {
    Bounds box;
    for (std::size_t i = first; i < std::min(boxes.size(), first + kValues); i += 6) box.add(&boxes[i], &boxes[i + 3]);
    box.append_to(districts);
  }
  return districts;
}

}  // namespace megablock
