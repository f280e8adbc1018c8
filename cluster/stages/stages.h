// The stages of a job, in order (architecture.md section 5). Each brings its units up to date on all ranks and returns
// what the next one needs to know; the data itself stays in the store.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cluster/job.h"
#include "cluster/work_queue.h"
#include "io/features.h"
#include "io/image_graph.h"
#include "io/tracks.h"

namespace megablock {

// Algorithm number of each stage: part of its fingerprints, raised when its results change.
namespace algorithm {
inline constexpr int kFeatures = 1, kCandidates = 1, kMatching = 12, kTiles = 3, kTracks = 3, kOrientation = 9,
                     kAdjustment = 17, kMerge = 19, kResult = 1;
}

inline constexpr std::int64_t kShardImages = 64;  // images per unit of feature extraction

std::string unit_name(const std::string& folder, std::int64_t number);  // "features/000003.h5"

// Features. fingerprint[image]: what the features of one image are computed from (file, mask, options).
struct FeatureStage {
  std::vector<std::uint64_t> image_fingerprint;
  std::vector<std::string> shards;
};
FeatureStage run_features(Job& job);

// Keypoints and descriptors by image, a few shards in memory at a time.
class FeatureCache {
 public:
  FeatureCache(const JobStore& store, std::size_t capacity_shards) : store_(store), capacity_(capacity_shards) {}
  const ImageFeatures& features(ImageIndex image);
  // Makes the shards of these images resident together; pointers stay valid until the next call.
  void load(const std::vector<ImageIndex>& images);

 private:
  struct Shard {
    std::int64_t number;
    std::vector<ImageFeatures> images;
  };
  const Shard& shard(std::int64_t number);
  const JobStore& store_;
  std::size_t capacity_;
  std::vector<Shard> shards_;  // least recently used first
};

// Candidate pairs and cells: graph.h5.
CandidateGraph run_candidates(Job& job, const FeatureStage& features);

// Matching: matches/<cell>.h5. Returns the unit names.
std::vector<std::string> run_matching(Job& job, const FeatureStage& features, const CandidateGraph& graph);

// Tiles and merge tree: tiles.h5, from verified matches or from given tracks.
Tiles run_tiles(Job& job, const std::vector<std::string>& matches);
Tiles run_tiles_of_tracks(Job& job, const std::string& tie_points);

// Tracks by owner tile: tracks/<tile>.h5 (ids: first image x 2^24 + feature, stable when a block grows; dense indices
// are given in the result). Returns the unit names by tile.
std::vector<std::string> run_tracks(Job& job, const std::vector<std::string>& matches, const Tiles& tiles);
std::vector<std::string> run_given_tracks(Job& job, const std::string& tie_points, const Tiles& tiles);

// Initial orientation: orient/<generation>.h5. Returns the block's state.
BlockState run_orientation(Job& job, const std::vector<std::string>& matches);

// Tile adjustments: adjust/<tile>.h5. Returns the unit names by tile; empty for tiles that could not be adjusted.
std::vector<std::string> run_adjustment(Job& job, const BlockState& oriented, const Tiles& tiles,
                                        const std::vector<std::string>& tracks);

// Merge and result: merge/..., result/block.h5, result/report.html. The job's block is not to be used afterwards.
void run_merge(Job& job, BlockState oriented, const Tiles& tiles, const std::vector<std::string>& tracks,
               const std::vector<std::string>& adjusted);

// Keypoints of every image (empty where extraction failed).
IndexedVector<ImageIndex, std::vector<Keypoint>> read_keypoints(const Job& job);

// Reads all matches of the units (in unit order).
std::vector<VerifiedPair> read_all_matches(const Job& job, const std::vector<std::string>& matches);

}  // namespace megablock
