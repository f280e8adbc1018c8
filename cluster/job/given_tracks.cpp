#include "cluster/job/given_tracks.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "cluster/process/process_memory.h"
#include "io/base/error.h"
#include "io/block/track_rows.h"
#include "io/store/units/track_reader.h"
#include "io/store/units/tracks_file.h"
#include "merge/scratch/bytes.h"

namespace megablock {

namespace {

TrackSet no_tracks() {
  TrackSet tracks;
  tracks.begin.push_back(0);
  return tracks;
}

// Collects the tracks of each tile. Tracks beyond the memory limit wait in a scratch file, one run after the other.
class TracksOfTiles {
 public:
  TracksOfTiles(std::int64_t tiles, std::string scratch_file, std::int64_t most)
      : held_(static_cast<std::size_t>(tiles), no_tracks()),
        runs_(held_.size()),
        path_(std::move(scratch_file)),
        most_(most) {}
  ~TracksOfTiles() {
    std::error_code ignored;
    if (file_) std::filesystem::remove(path_, ignored);
  }
  TracksOfTiles(const TracksOfTiles&) = delete;
  TracksOfTiles& operator=(const TracksOfTiles&) = delete;

  void add(TileIndex tile, const TrackSet& batch, std::int64_t track) {
    append_tracks(batch, track, track + 1, held_[static_cast<std::size_t>(tile.value)]);
    observations_ += batch.begin[track + 1] - batch.begin[track];
    if (observations_ > most_) write_all();
  }

  // Call it when all tracks are added. If some tracks wait in scratch, all do: a tile is then put together without the
  // tracks of other tiles in memory.
  void finish() {
    if (file_) write_all();
  }

  // The tracks of a tile, in the order in which they were added.
  TrackSet take(std::size_t tile) {
    if (runs_[tile].empty()) return std::exchange(held_[tile], {});
    TrackSet tracks = no_tracks();
    reserve(runs_[tile], tracks);
    for (const Run& run : runs_[tile]) {
      const TrackSet part = read(run);
      append_tracks(part, 0, part.track_count(), tracks);
    }
    return tracks;
  }

 private:
  struct Run {
    std::int64_t offset = 0, bytes = 0, tracks = 0, observations = 0;
  };
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  [[noreturn]] void fail(const char* what) const {
    throw StoreError(path_ + ": tracks could not be " + what + " (" + std::strerror(errno) +
                     "); make room on the disk of the job and run the same command again");
  }

  void write_all() {
    if (!file_) {
      std::error_code ignored;  // it is reported when the file cannot be opened
      std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), ignored);
      file_.reset(std::fopen(path_.c_str(), "w+b"));
      if (!file_) fail("written");
    }
    for (std::size_t tile = 0; tile < held_.size(); ++tile) {
      TrackSet& tracks = held_[tile];
      if (tracks.id.empty()) continue;
      ByteWriter writer;
      writer.values(tracks.id);
      writer.values(tracks.begin);
      writer.values(tracks.image);
      writer.values(tracks.x);
      writer.values(tracks.y);
      writer.values(tracks.feature);
      const Bytes bytes = writer.take();
      if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail("written");
      runs_[tile].push_back(
          {end_, static_cast<std::int64_t>(bytes.size()), tracks.track_count(), tracks.observation_count()});
      end_ += static_cast<std::int64_t>(bytes.size());
      tracks = no_tracks();
    }
    observations_ = 0;
    return_freed_memory();  // growing lists leave unused memory behind
  }

  // Reserves memory for exactly these tracks. A list that grows takes twice its memory for a while.
  static void reserve(const std::vector<Run>& runs, TrackSet& tracks) {
    std::int64_t own = 0, observations = 0;
    for (const Run& run : runs) {
      own += run.tracks;
      observations += run.observations;
    }
    const auto rows = static_cast<std::size_t>(observations);
    tracks.id.reserve(static_cast<std::size_t>(own));
    tracks.begin.reserve(static_cast<std::size_t>(own) + 1);
    tracks.image.reserve(rows);
    for (std::vector<std::int32_t>* column : {&tracks.x, &tracks.y, &tracks.feature}) column->reserve(rows);
  }

  TrackSet read(const Run& run) {
    Bytes bytes(static_cast<std::size_t>(run.bytes), '\0');
    if (std::fflush(file_.get()) != 0) fail("written");
    if (::fseeko(file_.get(), run.offset, SEEK_SET) != 0 ||
        std::fread(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size())
      fail("read back");
    ByteReader reader(bytes);
    TrackSet tracks;
    tracks.id = reader.values<TrackIndex>();
    tracks.begin = reader.values<std::int64_t>();
    tracks.image = reader.values<ImageIndex>();
    tracks.x = reader.values<std::int32_t>();
    tracks.y = reader.values<std::int32_t>();
    tracks.feature = reader.values<std::int32_t>();
    return tracks;
  }

  std::vector<TrackSet> held_;          // [tiles]
  std::vector<std::vector<Run>> runs_;  // [tiles] in the file
  const std::string path_;
  const std::int64_t most_;
  std::int64_t observations_ = 0, end_ = 0;
  std::unique_ptr<std::FILE, Close> file_;
};

}  // namespace

void check_images(const std::string& tie_points, const TrackSet& tracks, const Block& block) {
  for (const ImageIndex image : tracks.image)
    if (!block.images.contains(image))
      throw InputError(tie_points + ": names image " + std::to_string(image.value) + ", but the block has " +
                       std::to_string(block.images.size()) +
                       " images, counted from 0; 'tie_points' and 'block' of the "
                       "project do not belong together");
}

TrackSet read_given_tracks(const std::string& tie_points, const Block& block) {
  TrackSet tracks = read_tracks(tie_points);
  check_images(tie_points, tracks, block);
  return tracks;
}

void deal_given_tracks(const std::string& tie_points, const Block& block, const Tiles& tiles,
                       const std::string& scratch_file, const std::function<void(const TrackSet&)>& take,
                       const std::function<void()>& after_batch, std::int64_t observations_at_a_time) {
  TracksOfTiles dealt(tiles.tile_count, scratch_file, observations_at_a_time);
  TrackReader(tie_points).visit([&](const TrackSet& batch) {
    check_images(tie_points, batch, block);
    for (std::int64_t t = 0; t < batch.track_count(); ++t) {
      const ImageIndex* images = batch.image.data();
      const TileIndex owner = owner_tile(block, tiles, images + batch.begin[t], images + batch.begin[t + 1]);
      if (owner.valid()) dealt.add(owner, batch, t);
    }
    if (after_batch) after_batch();
  });
  dealt.finish();
  for (std::size_t tile = 0; tile < static_cast<std::size_t>(tiles.tile_count); ++tile) take(dealt.take(tile));
}

}  // namespace megablock
