// Reads and writes tracks (docs/reference/file-formats.md, "Tracks").
#include "io/store/units/tracks_file.h"

#include <algorithm>

#include "io/base/error.h"
#include "io/store/hdf5/hdf5_tables.h"
#include "io/store/units/track_reader.h"
#include "io/store/units/track_writer.h"

namespace megablock {

// The state of the delta coding after the rows written so far.
struct TrackCoding {
  std::int64_t last_id = 0, last_first_image = 0;
};

namespace {

struct Columns {
  std::vector<std::int64_t> id_difference, observations, image_difference;
};

// For each observation its image minus that of the previous observation of the track; for the first one, minus the
// first image of the previous track. Neighbouring tracks begin in neighbouring images, so the numbers are small and
// compress well.
std::vector<std::int64_t> image_differences(const TrackSet& tracks, std::int64_t& previous_first) {
  std::vector<std::int64_t> values(tracks.image.size());
  for (std::size_t t = 0; t < tracks.id.size(); ++t) {
    std::int64_t previous = previous_first;
    for (std::int64_t o = tracks.begin[t]; o < tracks.begin[t + 1]; ++o) {
      const auto row = static_cast<std::size_t>(o);
      values[row] = tracks.image[row].value - previous;
      previous = tracks.image[row].value;
      if (o == tracks.begin[t]) previous_first = previous;
    }
  }
  return values;
}

Columns encode(const TrackSet& tracks, TrackCoding& coded) {
  Columns columns;
  columns.id_difference = differences(plain(tracks.id));
  if (!tracks.id.empty()) {
    columns.id_difference.front() -= coded.last_id;
    coded.last_id = tracks.id.back().value;
  }
  columns.observations = counts_of(tracks.begin);
  columns.image_difference = image_differences(tracks, coded.last_first_image);
  return columns;
}

const char *const kTracks = "tracks", *const kIds = "tracks/id_difference", *const kCounts = "tracks/observations";
const char *const kObservations = "observations", *const kImages = "observations/image_difference";
const char *const kX = "observations/x", *const kY = "observations/y", *const kFeature = "observations/feature";

DatasetNote note_of(const std::string& name) {
  if (name == kIds) return {"", "global index, minus that of the row before"};
  if (name == kCounts) return {"", "number of observations of the track"};
  if (name == kImages)
    return {"",
            "image index, minus that of the observation before it in its track (a track's first: minus the first of "
            "the track before)"};
  if (name == kX) return {"2^-10 px", "to the right, pixel centres at +0.5"};
  if (name == kY) return {"2^-10 px", "down, pixel centres at +0.5"};
  return {"", "row in the image's features, -1: none"};
}

void make_groups(Hdf5Writer& file) {
  file.group(kTracks, "tie points' image measurements, one row per track");
  file.group(kObservations, "one row per observation, in the order of the tracks");
}

// The inverse of image_differences(). `previous_first` is the first image of the track before these, and then of the
// last one.
std::vector<ImageIndex> images_from(const std::vector<std::int64_t>& values, const std::vector<std::int64_t>& begin,
                                    std::int64_t& previous_first) {
  std::vector<ImageIndex> images(values.size());
  for (std::size_t t = 0; t + 1 < begin.size(); ++t) {
    std::int64_t previous = previous_first;
    for (std::int64_t o = begin[t]; o < begin[t + 1]; ++o) {
      const auto row = static_cast<std::size_t>(o);
      previous += values[row];
      images[row] = ImageIndex(previous);
      if (o == begin[t]) previous_first = previous;
    }
  }
  return images;
}

void check_order(const Hdf5Reader& file, const TrackSet& tracks, TrackIndex before = {}) {
  for (std::size_t t = 0; t < tracks.id.size(); ++t) {
    if (tracks.id[t] <= (t > 0 ? tracks.id[t - 1] : before)) file.fail(kIds, "indices do not ascend");
    ImageIndex previous;  // -1
    for (std::int64_t o = tracks.begin[t]; o < tracks.begin[t + 1]; ++o) {
      const ImageIndex image = tracks.image[static_cast<std::size_t>(o)];
      if (image <= previous) file.fail(kImages, "the images of a track do not ascend");
      previous = image;
    }
  }
}

}  // namespace

void write_tracks(const std::string& path, const TrackSet& tracks) {
  Hdf5Writer file(path, "tracks");
  make_groups(file);
  TrackCoding coded;
  const Columns columns = encode(tracks, coded);
  file.integers(kIds, columns.id_difference, note_of(kIds));
  file.integers(kCounts, columns.observations, note_of(kCounts));
  file.integers(kImages, columns.image_difference, note_of(kImages));
  file.vector(kX, tracks.x, note_of(kX));
  file.vector(kY, tracks.y, note_of(kY));
  file.vector(kFeature, tracks.feature, note_of(kFeature));
  file.close();
}

namespace {

// Growing datasets get their type before their values are known. Half the width saves a quarter of the file.
std::vector<std::int32_t> narrow(const std::vector<std::int64_t>& values) {
  std::vector<std::int32_t> narrowed;
  narrowed.reserve(values.size());
  for (const std::int64_t value : values) {
    if (value != static_cast<std::int32_t>(value))
      throw StoreError("tracks: a block may have at most 2^31 images; divide it into several blocks");
    narrowed.push_back(static_cast<std::int32_t>(value));
  }
  return narrowed;
}

}  // namespace

struct TrackWriter::File {
  explicit File(const std::string& path) : hdf5(path, "tracks", Hdf5Storage::kDisk) {}
  Hdf5Writer hdf5;
  TrackCoding coded;
};

TrackWriter::TrackWriter(const std::string& path) : file_(std::make_unique<File>(path)) {
  make_groups(file_->hdf5);
  file_->hdf5.growing<std::int64_t>(kIds, {}, note_of(kIds));
  for (const char* name : {kCounts, kImages, kX, kY, kFeature})
    file_->hdf5.growing<std::int32_t>(name, {}, note_of(name));
}

TrackWriter::~TrackWriter() = default;

void TrackWriter::append(const TrackSet& batch) {
  const Columns columns = encode(batch, file_->coded);
  file_->hdf5.append(kIds, columns.id_difference);
  file_->hdf5.append(kCounts, narrow(columns.observations));
  file_->hdf5.append(kImages, narrow(columns.image_difference));
  file_->hdf5.append(kX, batch.x);
  file_->hdf5.append(kY, batch.y);
  file_->hdf5.append(kFeature, batch.feature);
}

void TrackWriter::close() { file_->hdf5.close(); }

namespace {

// Everything except x, y and feature.
TrackSet structure_of(const Hdf5Reader& file) {
  TrackSet tracks;
  tracks.id = indices<TrackIndex>(cumulate(file.vector<std::int64_t>(kIds)));
  const std::vector<std::int64_t> images = file.vector<std::int64_t>(kImages);
  tracks.begin = begin_of(file, kCounts, file.vector<std::int64_t>(kCounts, tracks.track_count()),
                          static_cast<std::int64_t>(images.size()));
  std::int64_t previous_first = 0;
  tracks.image = images_from(images, tracks.begin, previous_first);
  return tracks;
}

}  // namespace

TrackSet TrackReader::images() const { return structure_of(file_); }

void TrackReader::visit(const std::function<void(const TrackSet&)>& take, const Wanted& wanted,
                        std::int64_t batch_observations) const {
  const std::int64_t tracks = file_.shape(kIds).at(0), observations = file_.shape(kImages).at(0);
  std::int64_t row = 0, id = 0, previous_first = 0;
  TrackIndex last;
  for (std::int64_t first = 0; first < tracks;) {
    // Tracks have two or more observations, so this many counts are enough for a batch. Fewer only make it smaller.
    const std::int64_t most = std::min(tracks - first, std::max<std::int64_t>(1, batch_observations / 2));
    std::vector<std::int64_t> counts = file_.rows<std::int64_t>(kCounts, {{first, most}});
    std::size_t taken = 0;
    std::int64_t sum = 0;
    // A batch has at least one track, however long it is.
    for (; taken < counts.size() && (taken == 0 || sum + counts[taken] <= batch_observations); ++taken)
      sum += counts[taken];
    counts.resize(taken);
    if (sum < 0 || row + sum > observations) file_.fail(kCounts, "does not add up to the number of observations");
    TrackSet batch;
    batch.begin = begin_of(file_, kCounts, counts);
    const auto batch_tracks = static_cast<std::int64_t>(taken);
    for (const std::int64_t difference : file_.rows<std::int64_t>(kIds, {{first, batch_tracks}}))
      batch.id.push_back(TrackIndex(id += difference));
    batch.image = images_from(file_.rows<std::int64_t>(kImages, {{row, sum}}), batch.begin, previous_first);
    check_order(file_, batch, last);
    if (wanted(first, batch_tracks)) {
      Measured values = measured({{row, sum}});
      batch.x = std::move(values.x);
      batch.y = std::move(values.y);
      batch.feature = std::move(values.feature);
    }
    take(batch);
    last = batch.id.back();
    first += batch_tracks;
    row += sum;
  }
  if (row != observations) file_.fail(kCounts, "does not add up to the number of observations");
}

// Image numbers fit into 32 bits (as TrackWriter ensures). That halves the memory, and reading memory takes longer than
// the search.
TrackReader::Found TrackReader::find(const std::vector<ImageIndex>& images) const {
  Found found;
  if (images.empty()) return found;
  const std::vector<std::int32_t> difference = file_.vector<std::int32_t>(kImages),
                                  count = file_.vector<std::int32_t>(kCounts);
  const std::int64_t first = images.front().value;
  std::vector<std::uint8_t> wanted(static_cast<std::size_t>(images.back().value - first + 1), 0);
  for (const ImageIndex image : images) wanted[static_cast<std::size_t>(image.value - first)] = 1;
  std::vector<std::size_t> track;
  std::size_t row = 0;
  std::int64_t previous_first = 0;
  for (std::size_t t = 0; t < count.size(); ++t) {
    if (count[t] < 0 || static_cast<std::size_t>(count[t]) > difference.size() - row)
      file_.fail(kCounts, "does not add up to the number of observations");
    std::int64_t image = previous_first;
    for (const std::size_t begin = row, end = row + static_cast<std::size_t>(count[t]); row < end; ++row) {
      image += difference[row];
      if (row == begin) previous_first = image;
      // A negative value becomes far larger than the end.
      const auto offset = static_cast<std::uint64_t>(image - first);
      if (offset >= wanted.size() || !wanted[offset]) continue;
      found.row.push_back(static_cast<std::int64_t>(row));
      found.image.emplace_back(image);
      track.push_back(t);
    }
  }
  const std::vector<std::int64_t> id = file_.vector<std::int64_t>(kIds, static_cast<std::int64_t>(count.size()));
  std::int64_t own = 0;
  std::size_t next = 0;
  for (const std::size_t t : track) {
    while (next <= t) own += id[next++];
    found.track.emplace_back(own);
  }
  return found;
}

TrackReader::Measured TrackReader::measured(const std::vector<RowRange>& ranges) const {
  return {file_.rows<std::int32_t>(kX, ranges), file_.rows<std::int32_t>(kY, ranges),
          file_.rows<std::int32_t>(kFeature, ranges)};
}

TrackSet read_tracks(const std::string& path) {
  const Hdf5Reader file(path, "tracks");
  TrackSet tracks = structure_of(file);
  tracks.x = file.vector<std::int32_t>(kX, tracks.observation_count());
  tracks.y = file.vector<std::int32_t>(kY, tracks.observation_count());
  tracks.feature = file.vector<std::int32_t>(kFeature, tracks.observation_count());
  check_order(file, tracks);
  return tracks;
}

}  // namespace megablock
