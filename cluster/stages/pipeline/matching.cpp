#include "cluster/stages/pipeline/matching.h"

#include <algorithm>
#include <map>

#include "adjust/orientation/vertical_check.h"
#include "cluster/job/work_queue.h"
#include "cluster/stages/common/block_hash.h"
#include "cluster/stages/common/units.h"
#include "cluster/stages/pipeline/features.h"
#include "geometry/numbers/angles.h"
#include "io/base/hash.h"
#include "io/project/inputs/verticals.h"
#include "io/store/units/graph_files.h"
#include "match/filter/match_filter.h"
#include "match/pairs/pair_matching.h"
#include "match/pairs/upright_matching.h"

namespace megablock {

namespace {

void add_camera(Hasher& hasher, const Camera& camera) {
  hasher.add(camera.width).add(camera.height).add(camera.focal_known);
  add_to_hash(hasher, camera.intrinsics);
}

// The directions in which images see down, where they are known to half a degree apart from the errors of the camera.
// These errors turn the verticals of both images of a pair alike, which hardly matters for one camera.
std::map<ImageIndex, AxisDirection> good_verticals(const Block& block) {
  constexpr double kGood = 0.5 * kDegree;
  std::map<ImageIndex, AxisDirection> good;
  for (const SeenVertical& vertical : block.verticals) {
    const Camera& camera = block.cameras[block.camera_of(vertical.image)];
    if (vertical.covariance.trace() <= 2 * kGood * kGood)
      good.emplace(vertical.image, whole_error(vertical, camera, camera.intrinsics));
  }
  return good;
}

// A pair of a cell. It is matched by its verticals when both images have one and their given poses do not contradict
// them.
struct CellPair {
  ImageIndex a, b;
  bool by_verticals = false;
};

// The knowledge about pairs before they are matched: the trajectory, and the verticals of the images.
struct Knowledge {
  explicit Knowledge(const Job& job)
      : trajectory(job.block, job.settings.matching.trust),
        filter(job.settings.matching.filter_model.empty() ? MatchFilter::shipped()
                                                          : MatchFilter::load(job.settings.matching.filter_model)),
        filtered(job.settings.matching.filter),
        verticals(good_verticals(job.block)),
        block(job.block) {}
  CellPair in_cell(const ImagePair& pair) const {
    const auto a = verticals.find(pair.a), b = verticals.find(pair.b);
    const bool both = a != verticals.end() && b != verticals.end();
    return {pair.a, pair.b, both && given_poses_join(block, pair.a, a->second, pair.b, b->second)};
  }
  PairKnowledge of(const CellPair& pair) const {
    PairKnowledge known{.orientation = trajectory.relate(pair.a, pair.b), .filter = filtered ? &filter : nullptr};
    if (pair.by_verticals) {
      known.vertical_a = verticals.at(pair.a);
      known.vertical_b = verticals.at(pair.b);
    }
    return known;
  }
  TrustedPairs trajectory;
  MatchFilter filter;
  bool filtered;
  std::map<ImageIndex, AxisDirection> verticals;
  const Block& block;
};

std::vector<CellPair> cell_pairs(const CandidateGraph& graph, std::size_t cell, const Knowledge& knowledge) {
  std::vector<CellPair> pairs;
  for (std::int64_t row = graph.cell_begin[cell]; row < graph.cell_begin[cell + 1]; ++row)
    pairs.push_back(
        knowledge.in_cell(graph.pairs[static_cast<std::size_t>(graph.cell_pairs[static_cast<std::size_t>(row)])]));
  return pairs;
}

// Algorithm number of the use of verticals in matching. Pairs without verticals stay valid when it is raised.
constexpr int kUprightMatching = 3;

std::uint64_t cell_fingerprint(const Stage& stage, const Job& job, const FeatureStage& features,
                               const std::vector<CellPair>& pairs, const Knowledge& knowledge) {
  Hasher hasher;
  hasher.add(stage.algorithm);
  add_to_hash(hasher, job.settings.matching);
  for (const CellPair& pair : pairs)
    if (const auto known = knowledge.trajectory.relate(pair.a, pair.b)) {
      add_to_hash(hasher, known->a);
      add_to_hash(hasher, known->b);
      hasher.add(known->rotation_sigma_rad).add(known->position_sigma_m);
      if (knowledge.filtered) hasher.add(knowledge.filter.hash());
    }
  for (const CellPair& pair : pairs) {
    for (const ImageIndex image : {pair.a, pair.b}) {
      hasher.add(image.value).add(features.image_fingerprint[static_cast<std::size_t>(image.value)]);
      add_camera(hasher, job.block.cameras[job.block.camera_of(image)]);
      if (!pair.by_verticals) continue;
      const AxisDirection& vertical = knowledge.verticals.at(image);
      hasher.add(kUprightMatching);
      add_to_hash(hasher, vertical.direction);
      for (const double value : vertical.covariance.reshaped()) hasher.add(value);
    }
  }
  return hasher.value();
}

using UprightSectors = std::map<ImageIndex, std::vector<std::int8_t>>;  // by image with a vertical

std::vector<StandingPair> standing_of(const Job& job, const std::vector<CellPair>& pairs,
                                      const std::vector<const ImageFeatures*>& a,
                                      const std::vector<const ImageFeatures*>& b, const UprightSectors& upright) {
  std::vector<StandingPair> standing(pairs.size());
#pragma omp parallel for schedule(dynamic, 1) num_threads(job.options.threads)
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    standing[i] = {pairs[i].a, pairs[i].b, Standing::kUnknown};
    if (pairs[i].by_verticals)
      standing[i].standing =
          standing_of_coarsest(*a[i], *b[i], upright.at(pairs[i].a), upright.at(pairs[i].b), job.settings.matching);
  }
  return standing;
}

std::vector<VerifiedPair> match_cell(const Job& job, FeatureCache& cache, const Knowledge& knowledge,
                                     const std::vector<CellPair>& pairs) {
  std::vector<ImageIndex> images;
  for (const CellPair& pair : pairs) images.insert(images.end(), {pair.a, pair.b});
  cache.load(images);
  std::vector<const ImageFeatures*> a(pairs.size()), b(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    a[i] = &cache.features(pairs[i].a);
    b[i] = &cache.features(pairs[i].b);
  }
  std::vector<VerifiedPair> verified(pairs.size());
  const Block& block = job.block;
  UprightSectors upright;
  for (const CellPair& pair : pairs) {
    if (!pair.by_verticals) continue;
    for (const ImageIndex image : {pair.a, pair.b})
      if (!upright.contains(image))
        upright[image] = upright_sectors(cache.features(image), block.cameras[block.camera_of(image)],
                                         knowledge.verticals.at(image).direction);
  }
  const std::vector<StandingPair> standing = standing_of(job, pairs, a, b, upright);
  const std::vector<std::uint8_t> stands_upright = upright_pairs(standing);
  const auto known = [&](std::size_t i) {
    PairKnowledge of_pair = knowledge.of(pairs[i]);
    if (stands_upright[i] && pairs[i].by_verticals) {
      of_pair.upright_a = &upright.at(pairs[i].a);
      of_pair.upright_b = &upright.at(pairs[i].b);
    }
    if (standing[i].standing == Standing::kTurned) of_pair.vertical_a = of_pair.vertical_b = std::nullopt;
    return of_pair;
  };
#pragma omp parallel for schedule(dynamic, 1) num_threads(job.options.threads)
  for (std::size_t i = 0; i < pairs.size(); ++i)
    verified[i] = match_pair(*a[i], *b[i], block.cameras[block.camera_of(pairs[i].a)],
                             block.cameras[block.camera_of(pairs[i].b)], job.settings.matching, known(i));
  std::erase_if(verified, [](const VerifiedPair& pair) { return pair.model == PairModel::kNone; });
  return verified;
}

}  // namespace

std::vector<std::string> run_matching(const Stage& stage, const Job& job, JobRecord& record,
                                      const FeatureStage& features, const CandidateGraph& graph) {
  constexpr std::size_t kResidentShards = 16;
  FeatureCache cache(job.store, kResidentShards);
  const Knowledge knowledge(job);
  std::vector<Unit> units;
  std::vector<std::string> names;
  for (std::size_t cell = 0; cell + 1 < graph.cell_begin.size(); ++cell) {
    const std::vector<CellPair> pairs = cell_pairs(graph, cell, knowledge);
    Unit unit;
    unit.name = unit_name(stage.folder(), static_cast<std::int64_t>(cell));
    unit.fingerprint = cell_fingerprint(stage, job, features, pairs, knowledge);
    unit.cost = static_cast<double>(pairs.size());
    unit.write = [&job, &cache, &knowledge, pairs](const std::string& path) {
      write_matches(path, match_cell(job, cache, knowledge, pairs));
    };
    names.push_back(unit.name);
    units.push_back(std::move(unit));
  }
  run_stage(job, record, stage, units);
  std::erase_if(names, [&](const std::string& name) { return !job.store.seal(name); });
  return names;
}

}  // namespace megablock
