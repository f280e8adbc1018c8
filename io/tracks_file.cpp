// Tracks: docs/job-format.md, "Tracks".
#include "io/hdf5_tables.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

// Image of each observation minus that of the observation before it in the track; a track's first minus the first of
// the track before. Neighbouring tracks begin in neighbouring images, so the numbers are small.
std::vector<std::int64_t> image_differences(const TrackSet& tracks) {
  std::vector<std::int64_t> values(tracks.image.size());
  std::int64_t previous_first = 0;
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

std::vector<ImageIndex> images_from(const std::vector<std::int64_t>& values, const std::vector<std::int64_t>& begin) {
  std::vector<ImageIndex> images(values.size());
  std::int64_t previous_first = 0;
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

void check_order(const Hdf5Reader& file, const TrackSet& tracks) {
  for (std::size_t t = 0; t < tracks.id.size(); ++t) {
    if (tracks.id[t].value < 0 || (t > 0 && tracks.id[t] <= tracks.id[t - 1]))
      file.fail("tracks/id_difference", "indices do not ascend");
    ImageIndex previous;  // -1
    for (std::int64_t o = tracks.begin[t]; o < tracks.begin[t + 1]; ++o) {
      const ImageIndex image = tracks.image[static_cast<std::size_t>(o)];
      if (image <= previous) file.fail("observations/image_difference", "the images of a track do not ascend");
      previous = image;
    }
  }
}

}  // namespace

void write_tracks(const std::string& path, const TrackSet& tracks) {
  Hdf5Writer file(path, "tracks");
  file.group("tracks", "tie points' image measurements, one row per track");
  file.integers("tracks/id_difference", differences(plain(tracks.id)),
                {"", "global index, minus that of the row before"});
  file.integers("tracks/observations", counts_of(tracks.begin), {"", "number of observations of the track"});
  file.group("observations", "one row per observation, in the order of the tracks");
  file.integers("observations/image_difference", image_differences(tracks),
                {"",
                 "image index, minus that of the observation before it in its track (a track's first: minus the "
                 "first of the track before)"});
  file.vector("observations/x", tracks.x, {"2^-10 px", "to the right, pixel centres at +0.5"});
  file.vector("observations/y", tracks.y, {"2^-10 px", "down, pixel centres at +0.5"});
  file.vector("observations/feature", tracks.feature, {"", "row in the image's features, -1: none"});
  file.close();
}

TrackSet read_tracks(const std::string& path) {
  const Hdf5Reader file(path, "tracks");
  TrackSet tracks;
  tracks.id = indices<TrackIndex>(cumulate(file.vector<std::int64_t>("tracks/id_difference")));
  tracks.x = file.vector<std::int32_t>("observations/x");
  const auto count = static_cast<std::int64_t>(tracks.x.size());
  tracks.y = file.vector<std::int32_t>("observations/y", count);
  tracks.feature = file.vector<std::int32_t>("observations/feature", count);
  tracks.begin = begin_of(file, "tracks/observations",
                          file.vector<std::int64_t>("tracks/observations", tracks.track_count()), count);
  tracks.image = images_from(file.vector<std::int64_t>("observations/image_difference", count), tracks.begin);
  check_order(file, tracks);
  return tracks;
}

}  // namespace megablock
