// Tracks of the whole block are built by one rank and dealt to the files of their owner tiles; tracks/index.txt, the
// unit of the stage, lists the content hash of every tile's file. A tile's file is rewritten only when its tracks
// changed, so that adding an image touches only the tiles it is seen in.

#include "match/tracks.h"

#include <algorithm>
#include <fstream>
#include <set>
#include <sstream>

#include "adjust/tile_problem.h"
#include "cluster/collective.h"
#include "cluster/stages/block_hash.h"
#include "cluster/stages/growth.h"
#include "cluster/stages/stages.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/unit_files.h"
#include "match/eccentricity.h"

namespace megablock {

namespace {

constexpr std::int64_t kFeatureBits = 24;  // SIFT features of one image stay far below 2^24

std::int64_t track_key(ImageIndex image, std::int32_t feature) { return (image.value << kFeatureBits) | feature; }

void append_track(TrackSet& to, const TrackSet& from, std::int64_t t) {
  to.id.push_back(from.id[t]);
  if (to.begin.empty()) to.begin.push_back(0);
  for (std::int64_t o = from.begin[t]; o < from.begin[t + 1]; ++o) {
    to.image.push_back(from.image[o]);
    to.x.push_back(from.x[o]);
    to.y.push_back(from.y[o]);
    to.feature.push_back(from.feature[o]);
  }
  to.begin.push_back(static_cast<std::int64_t>(to.image.size()));
}

std::vector<TrackSet> deal_to_tiles(const Job& job, const TrackSet& tracks, const Tiles& tiles) {
  std::vector<TrackSet> dealt(static_cast<std::size_t>(tiles.tile_count));
  for (TrackSet& set : dealt) set.begin.push_back(0);
  for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
    const TileIndex owner =
        owner_tile(job.block, tiles, tracks.image.data() + tracks.begin[t], tracks.image.data() + tracks.begin[t + 1]);
    if (owner.valid()) append_track(dealt[static_cast<std::size_t>(owner.value)], tracks, t);
  }
  return dealt;
}

std::uint64_t content_fingerprint(const TrackSet& tracks) {
  Hasher hasher;
  hasher.add(algorithm::kTracks).add(tracks.id).add(tracks.begin).add(tracks.image).add(tracks.x).add(tracks.y);
  hasher.add(tracks.feature);
  return hasher.value();
}

// The files named in the index are there and whole.
bool index_holds(const Job& job, const std::string& index, const std::vector<std::string>& names) {
  if (!job.store.seal(index)) return false;
  std::ifstream in(job.store.path(index));
  try {
    for (const std::string& name : names) {
      std::string listed, fingerprint;
      if (!(in >> listed >> fingerprint) || listed != name) return false;
      const auto seal = job.store.seal(name);
      if (!seal || hex(seal->fingerprint) != fingerprint) return false;
      job.store.verify(name);
    }
  } catch (const StoreError&) {
    return false;
  }
  return true;
}

std::vector<std::string> run_tracks_unit(Job& job, std::uint64_t inputs, const Tiles& tiles,
                                         const std::function<TrackSet()>& build) {
  Hasher hasher;
  hasher.add(algorithm::kTracks).add(inputs).add(job.store.seal("tiles.h5")->content_hash);
  Unit unit;
  unit.name = "tracks/index.txt";
  unit.fingerprint = hasher.value();
  std::vector<std::string> names;
  for (std::int64_t t = 0; t < tiles.tile_count; ++t) names.push_back(unit_name("tracks", t));
  unit.write = [&](const std::string& path) {
    const std::vector<TrackSet> dealt = deal_to_tiles(job, build(), tiles);
    std::ofstream out(path);
    for (std::size_t t = 0; t < dealt.size(); ++t) {
      const std::uint64_t fingerprint = content_fingerprint(dealt[t]);
      bool current = job.store.up_to_date(names[t], fingerprint);
      try {
        if (current) job.store.verify(names[t]);
      } catch (const StoreError&) {
        current = false;
      }
      if (!current) job.store.write(names[t], fingerprint, [&](const std::string& p) { write_tracks(p, dealt[t]); });
      out << names[t] << ' ' << hex(fingerprint) << '\n';
    }
  };
  if (job.is_first_rank() && !index_holds(job, unit.name, names)) job.store.remove(unit.name);
  job.ranks.barrier();
  run_stage(job, "tracks", {unit});
  if (!job.store.seal(unit.name))
    throw AgreedError<ComputeError>("no tracks could be built: " + job.failures.back().reason);
  return names;
}

// Pairs that take part, by the generation of their later image.
std::vector<std::vector<VerifiedPair>> pairs_by_generation(const Job& job, const std::vector<std::string>& matches,
                                                           const Tiles& tiles) {
  std::set<std::pair<FrameIndex, FrameIndex>> dropped;
  for (const FrameEdge& edge : tiles.dropped_links) dropped.insert({edge.a, edge.b});
  std::vector<std::vector<VerifiedPair>> pairs(job.generations.size());
  for (VerifiedPair& pair : read_all_matches(job, matches)) {
    const FrameIndex a = job.block.images[pair.a].frame, b = job.block.images[pair.b].frame;
    if (!dropped.contains({std::min(a, b), std::max(a, b)}))
      pairs[generation_of(job.generations, pair.b)].push_back(std::move(pair));
  }
  return pairs;
}

// A track of two images adds no check to its point. Such tracks stay only where one of their images has few longer ones
// by the time the later image comes; so a block that grows keeps the tracks it has.
constexpr std::int64_t kEnoughLongTracks = 200;

TrackSet build_block_tracks(const Job& job, const std::vector<std::string>& matches, const Tiles& tiles) {
  const auto keypoints = read_keypoints(job);
  TrackBuilder builder(keypoints);
  std::vector<IndexedVector<ImageIndex, std::int64_t>> long_tracks;  // by generation
  for (const std::vector<VerifiedPair>& pairs : pairs_by_generation(job, matches, tiles)) {
    builder.add(pairs);
    long_tracks.push_back(builder.long_tracks());
  }
  const TrackSet all = builder.tracks(job.settings.tracks);
  TrackSet kept;
  kept.begin.push_back(0);
  for (std::int64_t t = 0; t < all.track_count(); ++t) {
    const std::int64_t first = all.begin[t], length = all.begin[t + 1] - first;
    const auto& so_far = long_tracks[generation_of(job.generations, all.image[first + 1])];
    if (length > 2 || so_far[all.image[first]] < kEnoughLongTracks || so_far[all.image[first + 1]] < kEnoughLongTracks)
      append_track(kept, all, t);
  }
  for (std::int64_t t = 0; t < kept.track_count(); ++t)
    kept.id[t] = TrackIndex(track_key(kept.image[kept.begin[t]], kept.feature[kept.begin[t]]));
  if (job.settings.tracks.remove_eccentricity) remove_eccentricity(job.block, keypoints, kept);
  return kept;
}

}  // namespace

IndexedVector<ImageIndex, std::vector<Keypoint>> read_keypoints(const Job& job) {
  IndexedVector<ImageIndex, std::vector<Keypoint>> keypoints;
  const auto images = static_cast<std::int64_t>(job.block.images.size());
  for (std::int64_t shard = 0; shard * kShardImages < images; ++shard)
    for (ImageFeatures& image : read_keypoints(job.store.verified_path(unit_name("features", shard))))
      keypoints.push_back(std::move(image.keypoints));
  return keypoints;
}

std::vector<std::string> run_tracks(Job& job, const std::vector<std::string>& matches, const Tiles& tiles) {
  Hasher hasher;
  hasher.add(job.settings.tracks.min_length).add(job.generations).add(job.settings.tracks.remove_eccentricity);
  if (job.settings.tracks.remove_eccentricity)
    for (const Camera& camera : job.block.cameras) add_to_hash(hasher, camera.intrinsics);
  for (const std::string& name : matches) hasher.add(job.store.seal(name)->content_hash);
  return run_tracks_unit(job, hasher.value(), tiles, [&] { return build_block_tracks(job, matches, tiles); });
}

std::vector<std::string> run_given_tracks(Job& job, const std::string& tie_points, const Tiles& tiles) {
  return run_tracks_unit(job, hash_file(tie_points), tiles, [&] { return read_tracks(tie_points); });
}

}  // namespace megablock
