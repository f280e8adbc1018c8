#include "cluster/stages/merge_outcome.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include "cluster/gather_by_tile.h"
#include "cluster/matrix_bytes.h"
#include "cluster/stages/merge_start.h"
#include "cluster/stages/provenance.h"
#include "merge/gauge.h"

namespace megablock {

namespace {

std::vector<SeamCheck> seam_checks(const MergeTree& tree, const RankRunner::Posterior& posterior) {
  const std::vector<std::string> alarms = describe_seams(tree, posterior.seams, posterior.tile_checks);
  std::vector<SeamCheck> checks;
  std::size_t alarm = 0;
  for (const SeamReport& seam : posterior.seams) {
    SeamCheck check{seam.node, seam.statistic, seam.degrees, seam.threshold, ""};
    if (seam.alarm() && alarm < alarms.size()) check.note = alarms[alarm++];
    checks.push_back(check);
  }
  return checks;
}

constexpr int kCovarianceTag = 1 << 20;  // beyond those of the merge tree's nodes

// A message per tile, after their number and the cameras. Each tile's go as they are written: messages wait here.
void send_covariances(Job& job, Adjusted& adjusted) {
  std::vector<PoseCovariances> tiles = std::exchange(adjusted.covariances_of_tiles, {});
  ByteWriter head;
  head.value(tiles.size());
  for (const Eigen::MatrixXd& covariance : adjusted.camera_covariance) write_matrix(head, covariance);
  job.ranks.send(0, kCovarianceTag, head.take());
  for (PoseCovariances& tile : tiles) {
    ByteWriter writer;
    writer.value(tile.tile);
    writer.values(tile.frames);
    write_matrices(writer, std::exchange(tile.of_frames, {}));
    writer.values(tile.mounts);
    write_matrices(writer, tile.of_mounts);
    job.ranks.send(0, kCovarianceTag, writer.take());
  }
}

PoseCovariances read_covariances(const Bytes& bytes) {
  ByteReader reader(bytes);
  PoseCovariances tile{reader.value<std::int64_t>(), reader.values<FrameIndex>(), {}, {}, {}};
  tile.of_frames = read_matrices<BlockResult::Matrix6>(reader);
  tile.mounts = reader.values<MountId>();
  tile.of_mounts = read_matrices<BlockResult::Matrix6>(reader);
  return tile;
}

using TileOfMount = std::map<MountId, std::int64_t>;  // that its covariance is from

// Of a mount that of the lowest tile, in whatever order the tiles come.
void take_covariances(const PoseCovariances& tile, TileOfMount& tile_of_mount, Adjusted& adjusted) {
  for (std::size_t f = 0; f < tile.frames.size(); ++f)
    if (!tile.of_frames[f].isZero(0)) adjusted.frame_covariance[tile.frames[f]] = tile.of_frames[f];
  for (std::size_t m = 0; m < tile.mounts.size(); ++m) {
    if (tile.of_mounts[m].isZero(0)) continue;
    const MountId& mount = tile.mounts[m];
    const auto found = tile_of_mount.emplace(mount, tile.tile).first;
    if (found->second < tile.tile) continue;
    found->second = tile.tile;
    adjusted.mount_covariance[mount.rig][static_cast<std::size_t>(mount.mount)] = tile.of_mounts[m];
  }
}

void receive_covariances(Job& job, int from, TileOfMount& tile_of_mount, Adjusted& adjusted) {
  const Bytes bytes = job.ranks.receive(from, kCovarianceTag);
  ByteReader reader(bytes);
  const auto tiles = reader.value<std::size_t>();
  for (Eigen::MatrixXd& covariance : adjusted.camera_covariance)
    if (Eigen::MatrixXd camera = read_matrix(reader); !camera.isZero(0)) covariance = std::move(camera);
  for (std::size_t t = 0; t < tiles; ++t)
    take_covariances(read_covariances(job.ranks.receive(from, kCovarianceTag)), tile_of_mount, adjusted);
}

}  // namespace

std::string part_path(const Job& job, std::int64_t tile) {
  return job.store.path("merge/parts/" + std::to_string(tile) + ".bin");
}

void find_posterior(Job& job, const MergeInputs& inputs, const std::vector<MotionReference>& references,
                    RankRunner& runner, Adjusted& adjusted) {
  for (const Intrinsics& camera : adjusted.state.cameras)
    adjusted.camera_covariance.push_back(Eigen::MatrixXd::Zero(camera.size(), camera.size()));
  std::filesystem::create_directories(job.store.path("merge/parts"));
  adjusted.posterior = runner.posterior([&](const RankTile& tile, const TileCovariance& covariance) {
    adjusted.covariances_of_tiles.push_back(
        {tile.tile, tile.problem.frames, covariance.frames, tile.problem.mounts, covariance.mounts});
    for (std::size_t c = 0; c < tile.problem.cameras.size(); ++c)
      if (!covariance.cameras[c].isZero(0)) adjusted.camera_covariance[tile.problem.cameras[c]] = covariance.cameras[c];
    const auto t = static_cast<std::size_t>(tile.tile);
    const TrackSet tracks = read_split_tracks(job, inputs.tracks[t], inputs.adjusted[t]);
    adjusted.parts.push_back(write_part(part_path(job, tile.tile), tile, tracks, covariance));
    if (tile.problem.frames.empty()) return;
    const std::int32_t component = inputs.tiles.component[tile.problem.frames.front()];
    if (component < 0 || references[static_cast<std::size_t>(component)].length <= 0) return;
    adjusted.parts.back().component = component;
    adjusted.parts.back().motion =
        common_motion(tile.problem, tile.state, references[static_cast<std::size_t>(component)]);
  });
}

std::vector<TilePart> gather_parts(Job& job, const Adjusted& adjusted, std::size_t tile_count) {
  return gather_by_tile(job.ranks, tile_count, adjusted.parts, [&](std::size_t i) { return adjusted.parts[i].tile; });
}

void gather_covariances(Job& job, Adjusted& adjusted) {
  if (job.is_first_rank()) {
    adjusted.frame_covariance.assign(adjusted.state.frames.size(), BlockResult::Matrix6::Zero());
    for (const std::vector<Pose>& rig : adjusted.state.mounts)
      adjusted.mount_covariance.emplace_back(rig.size(), BlockResult::Matrix6::Zero());
    TileOfMount tile_of_mount;
    for (const PoseCovariances& tile : std::exchange(adjusted.covariances_of_tiles, {}))
      take_covariances(tile, tile_of_mount, adjusted);
    for (int r = 1; r < job.ranks.size(); ++r) receive_covariances(job, r, tile_of_mount, adjusted);
  } else {
    send_covariances(job, adjusted);
  }
  job.ranks.flush_sends();
}

std::vector<std::string> judge_motions(const Block& block, const Tiles& tiles, const std::vector<TilePart>& parts) {
  const std::vector<MotionReference> references = motion_references(block, tiles);
  std::vector<CommonMotion> motions(references.size());
  for (const TilePart& part : parts)
    if (part.component >= 0) motions[static_cast<std::size_t>(part.component)].add(part.motion);
  std::vector<std::string> lines;
  for (std::size_t c = 0; c < references.size(); ++c)
    for (const std::string& line : describe(judge(motions[c], references[c])))
      lines.push_back((references.size() > 1 ? "part " + std::to_string(c + 1) + ": " : "") + line);
  return lines;
}

MergeOutcome make_outcome(Adjusted& adjusted, const Block& block, const MergeTree& tree) {
  MergeOutcome outcome;
  outcome.state = std::move(adjusted.state);
  outcome.frame_covariance = std::move(adjusted.frame_covariance);
  outcome.camera_covariance = std::move(adjusted.camera_covariance);
  outcome.mount_covariance = std::move(adjusted.mount_covariance);
  const SubtreeSums& sums = adjusted.posterior.sums;
  outcome.chi2 = sums.weighted_squares;
  outcome.degrees_of_freedom =
      sums.residuals - sums.unknowns + static_cast<std::int64_t>(sums.held.size()) + sums.held_points;
  outcome.image_sigma_px = adjusted.image_sigma_px;
  outcome.global_iterations = adjusted.position.global.accepted;
  outcome.newton_decrement = std::sqrt(sums.decrement_squared);
  const BlockGauge& gauge = adjusted.posterior.gauge;
  outcome.gauge = judge_gauge(sums, gauge, names_of(block)).text;
  for (const BlockComponent& part : gauge.components)
    if (!part.columns.empty()) {
      outcome.free_parts.push_back({FrameIndex(part.lowest_frame), static_cast<std::int32_t>(part.columns.size())});
      outcome.degrees_of_freedom += part.defect;  // what only the datum fixes takes nothing of the observations
    }
  outcome.seams = seam_checks(tree, adjusted.posterior);
  outcome.observations = adjusted.posterior.observations;
  for (std::size_t k = 0; k < kObservationKinds; ++k)
    outcome.observations.kinds[k].scale = adjusted.position.scales.of[k];
  return outcome;
}

}  // namespace megablock
