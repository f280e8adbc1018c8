// Initial orientation, one unit per generation of the block: images that are added later are oriented with respect to
// those that were there, whose orientation stays what it was.

#include "adjust/orientation.h"

#include <algorithm>
#include <numeric>

#include "cluster/collective.h"
#include "cluster/stages/block_hash.h"
#include "cluster/stages/stages.h"
#include "io/error.h"
#include "io/hash.h"
#include "io/unit_files.h"
#include "match/tracks.h"

namespace megablock {

namespace {

void add_block_values(Hasher& hasher, const Block& block, std::int64_t images) {
  for (std::int64_t i = 0; i < images; ++i) {
    const Image& image = block.images[ImageIndex(i)];
    hasher.add(image.frame.value).add(image.mount).add(block.camera_of(ImageIndex(i)).value);
    const Frame& frame = block.frames[image.frame];
    add_priors_to_hash(hasher, frame);
    if (frame.given_pose) add_to_hash(hasher, *frame.given_pose);
  }
  for (const Camera& camera : block.cameras) {
    for (const double value : camera.intrinsics) hasher.add(value);
    for (const double value : camera.prior_sigma) hasher.add(value);
  }
}

// The frames of each connected component of the pairs, by first frame.
std::vector<std::vector<FrameIndex>> components(const Block& block, const std::vector<VerifiedPair>& pairs) {
  std::vector<std::int64_t> parent(block.frames.size());
  std::iota(parent.begin(), parent.end(), std::int64_t{0});
  const auto root = [&](std::int64_t f) {
    while (parent[f] != f) f = parent[f] = parent[parent[f]];
    return f;
  };
  for (const VerifiedPair& pair : pairs) {
    const std::int64_t a = root(block.images[pair.a].frame.value), b = root(block.images[pair.b].frame.value);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::vector<FrameIndex>> by_root(block.frames.size());
  for (std::size_t f = 0; f < parent.size(); ++f)
    by_root[root(static_cast<std::int64_t>(f))].push_back(FrameIndex(static_cast<std::int64_t>(f)));
  std::erase_if(by_root, [](const auto& frames) { return frames.size() < 2; });
  return by_root;
}

BlockState orient(const Job& job, BlockState state, const std::vector<VerifiedPair>& pairs) {
  const auto keypoints = read_keypoints(job);
  for (const std::vector<FrameIndex>& frames : components(job.block, pairs)) {
    if (std::all_of(frames.begin(), frames.end(), [&](FrameIndex f) { return state.oriented[f] != 0; })) continue;
    std::vector<VerifiedPair> own;
    for (const VerifiedPair& pair : pairs)
      if (std::binary_search(frames.begin(), frames.end(), job.block.images[pair.a].frame)) own.push_back(pair);
    const TrackSet tracks = build_tracks(keypoints, own, job.settings.tracks);
    try {
      state = orient_component(job.block, state, frames, own, tracks, job.settings.orientation).state;
    } catch (const ComputeError&) {
      // A component that cannot be oriented stays without poses; the result lists its images.
    }
  }
  return state;
}

}  // namespace

BlockState run_orientation(Job& job, const std::vector<std::string>& matches) {
  BlockState state = initial_state(job.block);
  if (std::all_of(state.oriented.begin(), state.oriented.end(), [](std::uint8_t o) { return o != 0; })) return state;
  if (matches.empty())
    throw AgreedError<InputError>("images without pose cannot be oriented from given tie points alone; give poses in the project file");
  std::uint64_t previous = 0;
  for (std::size_t g = 0; g < job.generations.size(); ++g) {
    // A cell belongs to the generation of its latest image.
    std::vector<VerifiedPair> pairs;
    Hasher hasher;
    hasher.add(algorithm::kOrientation).add(previous);
    add_to_hash(hasher, job.settings.orientation);
    add_block_values(hasher, job.block, job.generations[g]);
    for (const std::string& name : matches) {
      std::vector<VerifiedPair> cell = read_matches(job.store.verified_path(name));
      const bool later = std::any_of(cell.begin(), cell.end(),
                                     [&](const VerifiedPair& p) { return p.b.value >= job.generations[g]; });
      if (later) continue;
      hasher.add(job.store.seal(name)->content_hash);
      std::move(cell.begin(), cell.end(), std::back_inserter(pairs));
    }
    Unit unit;
    unit.name = unit_name("orient", static_cast<std::int64_t>(g));
    unit.fingerprint = hasher.value();
    unit.write = [&](const std::string& path) { write_state(path, orient(job, state, pairs)); };
    const StageOutcome outcome = run_stage(job, "orientation", {unit});
    if (!outcome.failures.empty()) throw AgreedError<ComputeError>("orientation failed: " + outcome.failures.front().reason);
    state = read_state(job.store.verified_path(unit.name));
    previous = job.store.seal(unit.name)->content_hash;
  }
  return state;
}

}  // namespace megablock
