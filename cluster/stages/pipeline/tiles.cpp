#include "cluster/stages/pipeline/tiles.h"

#include <algorithm>

#include "cluster/job/given_tracks.h"
#include "cluster/job/work_queue.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "cluster/stages/common/growth.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/track_reader.h"
#include "partition/links/link_weights.h"
#include "partition/tiles/tiles.h"

namespace megablock {

namespace {

// Extends the tiles as the block has grown, so that earlier frames keep their tiles.
Tiles grow_tiles(const Job& job, LinkWeights links) {
  Tiles tiles;
  for (std::size_t g = 0; g < job.generations.size(); ++g) {
    const std::int64_t frames = frames_of_first_images(job.block, job.generations[g]);
    const FrameGraph graph = links.graph(frames);
    if (g + 1 == job.generations.size()) {  // makes room for METIS
      links = {};
      job.tables.release();  // the images are not needed any more, because their frames are counted
      return_freed_memory();
    }
    tiles = g == 0 ? make_tiles(graph, job.settings.tiles) : extend_tiles(graph, tiles, job.settings.tiles);
  }
  return tiles;
}

Tiles run_tiles_unit(const Stage& stage, const Job& job, JobRecord& record, std::uint64_t inputs,
                     const std::function<LinkWeights()>& links) {
  Hasher hasher;
  hasher.add(stage.algorithm).add(inputs).add(job.generations);
  add_to_hash(hasher, job.settings.tiles);
  for (const Image& image : job.block.images) hasher.add(image.frame.value);
  Unit unit;
  unit.name = stage.makes;
  unit.fingerprint = hasher.value();
  unit.write = [&](const std::string& path) { write_tiles(path, grow_tiles(job, links())); };
  const StageOutcome outcome = run_stage(job, record, stage, {unit});
  if (!outcome.failures.empty()) throw AgreedError<ComputeError>("tiles failed: " + outcome.failures.front().reason);
  return read_tiles(job.store.verified_path(unit.name));
}

}  // namespace

Tiles run_tiles(const Stage& stage, const Job& job, JobRecord& record, const std::vector<std::string>& matches) {
  Hasher hasher;
  for (const std::string& name : matches) hasher.add(job.store.seal(name)->content_hash);
  return run_tiles_unit(stage, job, record, hasher.value(), [&] {
    LinkWeights links;
    for (const std::string& name : matches)
      for (const VerifiedPair& pair : read_matches(job.store.verified_path(name)))
        links.add(job.block.images[pair.a].frame, job.block.images[pair.b].frame,
                  static_cast<std::int64_t>(pair.feature_a.size()));
    return links;
  });
}

Tiles run_tiles_of_tracks(const Stage& stage, const Job& job, JobRecord& record, const std::string& tie_points) {
  return run_tiles_unit(stage, job, record, hash_file(tie_points), [&] {
    LinkWeights links;
    std::vector<FrameIndex> frames;
    const auto add_tracks = [&](const TrackSet& tracks) {
      check_images(tie_points, tracks, job.block);
      for (std::int64_t t = 0; t < tracks.track_count(); ++t) {
        frames.clear();
        for (std::int64_t o = tracks.begin[t]; o < tracks.begin[t + 1]; ++o)
          frames.push_back(job.block.images[tracks.image[o]].frame);
        std::sort(frames.begin(), frames.end());
        frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
        for (std::size_t i = 0; i < frames.size(); ++i)
          for (std::size_t j = i + 1; j < frames.size(); ++j) links.add(frames[i], frames[j], 1);
      }
      job.tables.release();
    };
    TrackReader(tie_points).visit(add_tracks, [](std::int64_t, std::int64_t) { return false; });
    return links;
  });
}

}  // namespace megablock
