#include "cluster/stages/pipeline/candidates.h"

#include "cluster/job/work_queue.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/common/growth.h"
#include "cluster/stages/pipeline/features.h"
#include "io/base/hash.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"
#include "partition/candidates/candidates.h"

namespace megablock {

namespace {

GlobalDescriptors read_descriptors(const Job& job, const FeatureStage& features) {
  GlobalDescriptors all;
  for (const std::string& shard : features.shards)
    for (const ImageFeatures& image : read_keypoints(job.store.verified_path(shard)))
      all.push_back(image.global_descriptor);
  return all;
}

std::uint64_t candidates_fingerprint(const Stage& stage, const Job& job, const FeatureStage& features) {
  Hasher hasher;
  hasher.add(stage.algorithm);
  add_to_hash(hasher, job.settings.candidates);
  hasher.add(features.image_fingerprint).add(job.generations);
  for (ImageIndex i(0); job.block.images.contains(i); ++i.value)
    hasher.add(job.block.image_names[i]).add(job.block.images[i].frame.value).add(job.block.images[i].mount);
  for (const Camera& camera : job.block.cameras)
    hasher.add(camera.width).add(camera.height).add(camera.intrinsics[kFocal]).add(camera.intrinsics.model().kind);
  for (const Rig& rig : job.block.rigs)
    for (const Mount& mount : rig.mounts) add_to_hash(hasher, mount.pose);
  for (const Frame& frame : job.block.frames) {
    hasher.add(frame.name).add(frame.pass).add(frame.time_s).add(frame.rig.value);
    if (frame.position_prior) add_to_hash(hasher.add('p'), *frame.position_prior);
    if (frame.attitude_prior) add_to_hash(hasher.add('a'), *frame.attitude_prior);
    if (frame.given_pose) add_to_hash(hasher.add('g'), *frame.given_pose);
  }
  return hasher.value();
}

}  // namespace

CandidateGraph run_candidates(const Stage& stage, const Job& job, JobRecord& record, const FeatureStage& features) {
  Unit unit;
  unit.name = stage.makes;
  unit.fingerprint = candidates_fingerprint(stage, job, features);
  unit.write = [&](const std::string& path) {
    const GlobalDescriptors descriptors = read_descriptors(job, features);
    // Grown step by step as the block has grown, so that pairs and cells of earlier images stay the same.
    CandidateGraph graph;
    std::int64_t before = 0;
    for (const std::int64_t n : job.generations) {
      const Block part = first_images(job.block, n);
      GlobalDescriptors some(descriptors.begin(), descriptors.begin() + n);
      graph = before == 0 ? candidate_pairs(part, some, job.settings.candidates)
                          : extend_candidates(graph, part, some, job.settings.candidates, ImageIndex(before));
      before = n;
    }
    write_candidates(path, graph);
  };
  run_stage(job, record, stage, {unit});
  return read_candidates(job.store.verified_path(unit.name));
}

}  // namespace megablock
