// Runs the stage of features. It makes features/<shard>.h5, keypoints and descriptors of 64 images each.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/stage.h"
#include "cluster/stages/common/units.h"
#include "io/block/features.h"

namespace megablock {

// The outcome of the stage: a fingerprint of the features of each image (of its file, its mask and the options), and
// the units.
struct FeatureStage {
  std::vector<std::uint64_t> image_fingerprint;
  std::vector<std::string> shards;
};
FeatureStage run_features(const Stage& stage, const Job& job, JobRecord& record);

// The unit of a shard, for the stages that read it.
std::string feature_unit(std::int64_t shard);

// Reads keypoints and descriptors by image, with a few shards in memory at a time.
class FeatureCache {
 public:
  FeatureCache(const JobStore& store, std::size_t capacity_shards) : store_(store), capacity_(capacity_shards) {}
  const ImageFeatures& features(ImageIndex image);
  // Loads the shards of these images, all at the same time. References stay valid until the next call.
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

// The keypoints of every image; empty where extraction failed.
IndexedVector<ImageIndex, std::vector<Keypoint>> read_keypoints(const Job& job);

}  // namespace megablock
