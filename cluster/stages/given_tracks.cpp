#include "cluster/stages/given_tracks.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "adjust/tile_problem.h"
#include "io/error.h"
#include "io/track_reader.h"
#include "io/unit_files.h"

namespace megablock {

namespace {

using TileNumber = std::int32_t;

struct Owners {
  std::vector<TileNumber> of_track;        // [rows of the file], -1: none
  std::vector<std::int64_t> observations;  // [tiles]
};

Owners find_owners(const std::string& path, const TrackReader& file, const Block& block, const Tiles& tiles) {
  if (tiles.tile_count > std::numeric_limits<TileNumber>::max()) throw ComputeError("more than 2^31 tiles");
  Owners owners;
  owners.observations.resize(static_cast<std::size_t>(tiles.tile_count), 0);
  const auto add = [&](const TrackSet& batch) {
    check_images(path, batch, block);
    for (std::int64_t t = 0; t < batch.track_count(); ++t) {
      const ImageIndex* images = batch.image.data();
      const TileIndex owner = owner_tile(block, tiles, images + batch.begin[t], images + batch.begin[t + 1]);
      owners.of_track.push_back(static_cast<TileNumber>(owner.value));
      if (owner.valid())
        owners.observations[static_cast<std::size_t>(owner.value)] += batch.begin[t + 1] - batch.begin[t];
    }
  };
  file.visit(add, [](std::int64_t, std::int64_t) { return false; });
  return owners;
}

void append_track(const TrackSet& from, std::int64_t t, TrackSet& tracks) {
  const auto append = [&](const auto& values, auto& to) {
    to.insert(to.end(), values.begin() + from.begin[t], values.begin() + from.begin[t + 1]);
  };
  tracks.id.push_back(from.id[t]);
  append(from.image, tracks.image);
  append(from.x, tracks.x);
  append(from.y, tracks.y);
  append(from.feature, tracks.feature);
  tracks.begin.push_back(tracks.observation_count());
}

// Tracks of the tiles [first, last).
std::vector<TrackSet> read_tiles(const TrackReader& file, const Owners& owners, TileNumber first, TileNumber last) {
  std::vector<TrackSet> tiles(static_cast<std::size_t>(last - first));
  for (TrackSet& tile : tiles) tile.begin.push_back(0);
  const auto ours = [&](TileNumber owner) { return owner >= first && owner < last; };
  std::int64_t row = 0;  // of the batch's first track
  const auto take = [&](const TrackSet& batch) {
    for (std::int64_t t = 0; t < batch.track_count() && !batch.x.empty(); ++t) {
      const TileNumber owner = owners.of_track[static_cast<std::size_t>(row + t)];
      if (ours(owner)) append_track(batch, t, tiles[static_cast<std::size_t>(owner - first)]);
    }
    row += batch.track_count();
  };
  file.visit(take, [&](std::int64_t begin, std::int64_t count) {
    return std::any_of(owners.of_track.begin() + begin, owners.of_track.begin() + begin + count, ours);
  });
  return tiles;
}

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
                       const std::function<void(const TrackSet&)>& take, std::int64_t observations_at_a_time) {
  const TrackReader file(tie_points);
  const Owners owners = find_owners(tie_points, file, block, tiles);
  const auto count = static_cast<TileNumber>(tiles.tile_count);
  for (TileNumber first = 0, last; first < count; first = last) {
    std::int64_t held = 0;
    for (last = first; last < count; ++last) {
      held += owners.observations[static_cast<std::size_t>(last)];
      if (last > first && held > observations_at_a_time) break;
    }
    for (const TrackSet& tile : read_tiles(file, owners, first, last)) take(tile);
  }
}

}  // namespace megablock
