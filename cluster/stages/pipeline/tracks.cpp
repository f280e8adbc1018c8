#include "cluster/stages/pipeline/tracks.h"

// One rank builds the tracks of the whole block, in memory that does not grow with the matches (match/tracks/tracks.h),
// and writes them tile by tile. tracks/index.txt, the unit of the stage, lists the content hash of every tile's file.
// The file of a tile is only rewritten when its tracks have changed, so that adding an image touches only the tiles in
// which it is seen.

#include <algorithm>
#include <fstream>
#include <numeric>
#include <set>
#include <sstream>

#include "adjust/problem/tile_problem.h"
#include "cluster/job/given_tracks.h"
#include "cluster/job/messages.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/common/growth.h"
#include "cluster/stages/common/units.h"
#include "cluster/stages/pipeline/features.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/result/measurement_index.h"
#include "io/result/measurements.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/tracks_file.h"
#include "match/features/eccentricity.h"
#include "match/tracks/tracks.h"

namespace megablock {

namespace {

constexpr std::int64_t kFeatureBits = 24;  // one image has far fewer than 2^24 SIFT features

std::int64_t track_key(ImageIndex image, std::int32_t feature) { return (image.value << kFeatureBits) | feature; }

// A source of tracks: it calls its argument with the tracks of tile 0, 1, ... in turn.
using TracksByTile = std::function<void(const std::function<void(const TrackSet&)>&)>;

std::uint64_t content_fingerprint(const Stage& stage, const TrackSet& tracks) {
  Hasher hasher;
  hasher.add(stage.algorithm).add(tracks.id).add(tracks.begin).add(tracks.image).add(tracks.x).add(tracks.y);
  hasher.add(tracks.feature);
  return hasher.value();
}

// Whether the files that the index names exist and are undamaged.
bool index_holds(const Job& job, const std::string& index, const std::vector<std::string>& names) {
  if (!job.store.seal(index)) return false;
  std::ifstream in(job.store.path(index));
  for (const std::string& name : names) {
    std::string listed, fingerprint;
    if (!(in >> listed >> fingerprint) || listed != name) return false;
    const auto seal = job.store.seal(name);
    if (!seal || hex(seal->fingerprint) != fingerprint || !job.store.problem(name).empty()) return false;
  }
  return true;
}

std::vector<std::string> run_tracks_unit(const Stage& stage, const Job& job, JobRecord& record, std::uint64_t inputs,
                                         const Tiles& tiles, const TracksByTile& tracks_by_tile) {
  Hasher hasher;
  hasher.add(stage.algorithm).add(inputs).add(job.store.seal("tiles.h5")->content_hash);
  Unit unit;
  unit.name = kTrackList;
  unit.fingerprint = hasher.value();
  std::vector<std::string> names;
  for (std::int64_t t = 0; t < tiles.tile_count; ++t) names.push_back(unit_name(stage.folder(), t));
  unit.write = [&](const std::string& path) {
    std::ofstream out(path);
    std::size_t t = 0;
    tracks_by_tile([&](const TrackSet& tracks) {
      const std::uint64_t fingerprint = content_fingerprint(stage, tracks);
      if (!is_current(job, stage.name, names[t], fingerprint))
        job.store.write(names[t], fingerprint, [&](const std::string& p) { write_tracks(p, tracks); });
      out << names[t++] << ' ' << hex(fingerprint) << '\n';
      return_freed_memory();
    });
  };
  if (job.is_first_rank() && !index_holds(job, unit.name, names)) job.store.remove(unit.name);
  job.ranks.barrier();
  run_stage(job, record, stage, {unit});
  if (!job.store.seal(unit.name))
    throw AgreedError<ComputeError>("no tracks could be built: " + record.failures.back().reason);
  return names;
}

// Adds the pairs that take part to the builder, each in the generation of its later image.
void add_pairs(const Job& job, const std::vector<std::string>& matches, const Tiles& tiles, TrackBuilder& builder) {
  std::set<std::pair<FrameIndex, FrameIndex>> dropped;
  for (const FrameEdge& edge : tiles.dropped_links) dropped.insert({edge.a, edge.b});
  for (const std::string& name : matches)
    for (const VerifiedPair& pair : read_matches(job.store.verified_path(name))) {
      const FrameIndex a = job.block.images[pair.a].frame, b = job.block.images[pair.b].frame;
      if (!dropped.contains({std::min(a, b), std::max(a, b)}))
        builder.add(pair, static_cast<std::int32_t>(generation_of(job.generations, pair.b)));
    }
}

// A track of two images adds no check to its point. Such tracks only stay where one of their images has few longer
// tracks when the later image is added. A block that grows therefore keeps its tracks.
constexpr std::int64_t kEnoughLongTracks = 200;

bool stays(const Job& job, const TrackBuilder& builder, const Track& track) {
  if (track.images.size() > 2) return true;
  const auto generation = static_cast<std::int32_t>(generation_of(job.generations, track.images[1]));
  const auto& so_far = builder.long_tracks(generation);
  return so_far[track.images[0]] < kEnoughLongTracks || so_far[track.images[1]] < kEnoughLongTracks;
}

// The tracks that stay, by the tile that owns them: those of tile t are numbers[begin[t] ...), ascending.
struct OwnedTracks {
  std::vector<std::int64_t> begin;
  std::vector<FeatureNumber> numbers;
};

OwnedTracks deal_to_tiles(const Job& job, const TrackBuilder& builder, const Tiles& tiles) {
  const auto visit = [&](const auto& take) {
    builder.visit(job.settings.tracks.min_length, [&](const Track& track) {
      if (!stays(job, builder, track)) return;
      const ImageIndex* images = track.images.data();
      const TileIndex owner = owner_tile(job.block, tiles, images, images + track.images.size());
      if (owner.valid()) take(static_cast<std::size_t>(owner.value), track.first);
    });
  };
  OwnedTracks owned;
  owned.begin.assign(static_cast<std::size_t>(tiles.tile_count) + 1, 0);
  visit([&](std::size_t tile, FeatureNumber) { ++owned.begin[tile + 1]; });
  std::partial_sum(owned.begin.begin(), owned.begin.end(), owned.begin.begin());
  owned.numbers.resize(static_cast<std::size_t>(owned.begin.back()));
  std::vector<std::int64_t> next = owned.begin;
  visit(
      [&](std::size_t tile, FeatureNumber number) { owned.numbers[static_cast<std::size_t>(next[tile]++)] = number; });
  return owned;
}

void append_track(const Track& track, TrackSet& tracks) {
  tracks.id.push_back(TrackIndex(track_key(track.images.front(), track.features.front())));
  tracks.image.insert(tracks.image.end(), track.images.begin(), track.images.end());
  tracks.feature.insert(tracks.feature.end(), track.features.begin(), track.features.end());
  tracks.begin.push_back(static_cast<std::int64_t>(tracks.image.size()));
}

std::vector<ImageFeatures> shard_keypoints(const Job& job, std::int64_t shard) {
  return read_keypoints(job.store.verified_path(feature_unit(shard)));
}

// Fills in the positions of the observations in the images of one shard: rows [first, last) of `order`.
void measure(const Job& job, std::int64_t shard, const std::int64_t* first, const std::int64_t* last,
             TrackSet& tracks) {
  const std::vector<ImageFeatures> features = shard_keypoints(job, shard);
  for (const std::int64_t* row = first; row != last; ++row) {
    const auto image = static_cast<std::size_t>(tracks.image[static_cast<std::size_t>(*row)].value % kShardImages);
    const std::int32_t feature = tracks.feature[static_cast<std::size_t>(*row)];
    if (image >= features.size() || static_cast<std::size_t>(feature) >= features[image].keypoints.size())
      throw StoreError(feature_unit(shard) + ": feature " + std::to_string(feature) +
                       " is missing, which a match names; delete the job's folder 'matches' and run it again");
  }
  const bool remove = job.settings.tracks.remove_eccentricity;
  const std::ptrdiff_t count = last - first;
#pragma omp parallel for schedule(static) num_threads(job.options.threads)
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const auto row = static_cast<std::size_t>(first[i]);
    const ImageIndex image = tracks.image[row];
    const Keypoint& keypoint = features[static_cast<std::size_t>(image.value % kShardImages)]
                                   .keypoints[static_cast<std::size_t>(tracks.feature[row])];
    const Camera& camera = job.block.cameras[job.block.camera_of(image)];
    const FixedPixel pixel =
        remove ? without_eccentricity(camera.intrinsics, keypoint) : FixedPixel{keypoint.x, keypoint.y};
    tracks.x[row] = pixel.x;
    tracks.y[row] = pixel.y;
  }
}

// Fills in all positions shard by shard, so that the keypoints of only 64 images are in memory at a time.
void measure(const Job& job, TrackSet& tracks) {
  tracks.x.resize(tracks.image.size());
  tracks.y.resize(tracks.image.size());
  std::vector<std::int64_t> order(tracks.image.size());
  std::iota(order.begin(), order.end(), std::int64_t{0});
  const auto shard_of = [&](std::int64_t row) {
    return tracks.image[static_cast<std::size_t>(row)].value / kShardImages;
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::int64_t i, std::int64_t j) { return shard_of(i) < shard_of(j); });
  for (std::size_t first = 0, last; first < order.size(); first = last) {
    const std::int64_t shard = shard_of(order[first]);
    for (last = first; last < order.size() && shard_of(order[last]) == shard;) ++last;
    measure(job, shard, order.data() + first, order.data() + last, tracks);
  }
}

void build_tracks_by_tile(const Job& job, const std::vector<std::string>& matches, const Tiles& tiles,
                          const std::function<void(const TrackSet&)>& take) {
  MatchMemory memory;
  memory.scratch_file = job.store.path("scratch/matches");
  TrackBuilder builder(job.block.images.size(), memory);
  add_pairs(job, matches, tiles, builder);
  builder.build();
  const OwnedTracks owned = deal_to_tiles(job, builder, tiles);
  for (std::size_t tile = 0; tile + 1 < owned.begin.size(); ++tile) {
    TrackSet tracks;
    tracks.begin.push_back(0);
    for (std::int64_t i = owned.begin[tile]; i < owned.begin[tile + 1]; ++i)
      append_track(builder.track(owned.numbers[static_cast<std::size_t>(i)]), tracks);
    measure(job, tracks);
    take(tracks);
  }
}

}  // namespace

IndexedVector<ImageIndex, std::vector<Keypoint>> read_keypoints(const Job& job) {
  IndexedVector<ImageIndex, std::vector<Keypoint>> keypoints;
  const auto images = static_cast<std::int64_t>(job.block.images.size());
  for (std::int64_t shard = 0; shard * kShardImages < images; ++shard)
    for (ImageFeatures& image : shard_keypoints(job, shard)) keypoints.push_back(std::move(image.keypoints));
  return keypoints;
}

std::vector<std::string> run_tracks(const Stage& stage, const Job& job, JobRecord& record,
                                    const std::vector<std::string>& matches, const Tiles& tiles) {
  Hasher hasher;
  hasher.add(job.settings.tracks.min_length).add(job.generations).add(job.settings.tracks.remove_eccentricity);
  if (job.settings.tracks.remove_eccentricity)
    for (const Camera& camera : job.block.cameras) add_to_hash(hasher, camera.intrinsics);
  for (const std::string& name : matches) hasher.add(job.store.seal(name)->content_hash);
  return run_tracks_unit(stage, job, record, hasher.value(), tiles,
                         [&](const auto& take) { build_tracks_by_tile(job, matches, tiles, take); });
}

std::vector<std::string> run_given_tracks(const Stage& stage, const Job& job, JobRecord& record,
                                          const std::string& tie_points, const Tiles& tiles) {
  return run_tracks_unit(stage, job, record, hash_file(tie_points), tiles, [&](const auto& take) {
    deal_given_tracks(tie_points, job.block, tiles, job.store.path("scratch/tracks"), take,
                      [&job] { job.tables.release(); });
  });
}

void index_measurements(const Job& job, const std::vector<std::string>& tracks) {
  const std::string damage = on_first_rank(job.ranks, [&] { return update_measurement_index(job.store, tracks); });
  if (!damage.empty() && job.is_first_rank()) warn_of_damage(job.store, job.log, "tracks", kMeasurementIndex, damage);
}

}  // namespace megablock
