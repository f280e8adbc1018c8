#include "cluster/stages/merge/merge_outcome.h"

#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ranges>

#include "cluster/mpi/matrix_bytes.h"
#include "cluster/stages/merge/merge_start.h"
#include "cluster/stages/result/provenance.h"
#include "geometry/numbers/decompositions.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "merge/checks/seam_text.h"
#include "merge/datum/gauge.h"
#include "merge/tile/cluster_scores.h"
#include "merge/tree/gather_by_tile.h"

namespace megablock {

namespace {

std::vector<SeamCheck> seam_checks(const MergeTree& tree, const MergeTreeRunner::Posterior& posterior) {
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

void write_file(const std::string& path, const Bytes& bytes) {
  errno = 0;
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw_file_error(path, "written", errno);
}

Bytes read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  Bytes bytes{std::istreambuf_iterator<char>(file), {}};
  if (bytes.empty()) throw StoreError("cannot read " + path + "; run again to resume");
  return bytes;
}

// Writes the covariances of the frames, cameras, mounts and control points of a tile; zero for an unknown that the tile
// does not touch.
void write_covariances(const std::string& path, const TileProblem& problem, const TileCovariance& covariance) {
  ByteWriter writer;
  writer.values(problem.frames);
  write_matrices(writer, covariance.frames);
  write_matrices(writer, covariance.aligned_frames);
  writer.values(problem.mounts);
  write_matrices(writer, covariance.mounts);
  writer.values(problem.cameras);
  for (const Eigen::MatrixXd& camera : covariance.cameras) write_matrix(writer, camera);
  std::vector<std::int64_t> control;
  std::vector<Eigen::Matrix3d> of_control;
  for (std::size_t p = 0; p < problem.points.size() && p < covariance.points.size(); ++p)
    if (problem.points[p].role != PointRole::kTie) {
      control.push_back(problem.points[p].index);
      of_control.push_back(covariance.points[p]);
    }
  writer.values(control);
  write_matrices(writer, of_control);
  write_file(path, writer.take());
}

// A frame of several tiles has the same bits in all of them. For a mount or a camera those of the lowest tile are
// taken.
template <typename Matrix>
void take_first(const Matrix& from, Matrix& to) {
  if (to.isZero(0)) to = from;
}

void read_covariances(const std::string& path, BlockResult::Empirical& to) {
  const Bytes bytes = read_file(path);
  ByteReader reader(bytes);
  const auto frames = reader.values<FrameIndex>();
  const auto of_frames = read_matrices<BlockResult::Matrix6>(reader);
  for (std::size_t f = 0; f < frames.size(); ++f) take_first(of_frames[f], to.frame_covariance[frames[f]]);
  const auto aligned = read_matrices<BlockResult::Matrix6>(reader);
  for (std::size_t f = 0; f < aligned.size(); ++f) take_first(aligned[f], to.aligned_covariance[frames[f]]);
  const auto mounts = reader.values<MountId>();
  const auto of_mounts = read_matrices<BlockResult::Matrix6>(reader);
  for (std::size_t m = 0; m < mounts.size(); ++m)
    take_first(of_mounts[m], to.mount_covariance[mounts[m].rig][static_cast<std::size_t>(mounts[m].mount)]);
  for (const CameraIndex camera : reader.values<CameraIndex>())
    take_first(read_matrix(reader), to.camera_covariance[camera]);
  const auto control = reader.values<std::int64_t>();
  const auto of_control = read_matrices<Eigen::Matrix3d>(reader);
  for (std::size_t p = 0; p < control.size(); ++p) to.control[static_cast<std::size_t>(control[p])] = of_control[p];
}

BlockResult::Empirical read_covariances(const Job& job, const Tiles& tiles, const BlockState& state,
                                        std::string (*path)(const Job&, std::int64_t)) {
  BlockResult::Empirical all;
  all.frame_covariance.assign(state.frames.size(), BlockResult::Matrix6::Zero());
  all.aligned_covariance = all.frame_covariance;
  for (const Intrinsics& camera : state.cameras)
    all.camera_covariance.push_back(Eigen::MatrixXd::Zero(camera.size(), camera.size()));
  for (const std::vector<Pose>& rig : state.mounts)
    all.mount_covariance.emplace_back(rig.size(), BlockResult::Matrix6::Zero());
  all.control.assign(job.block.control_points.size(), Eigen::Matrix3d::Zero());
  for (std::int64_t tile = 0; tile < tiles.tile_count; ++tile) read_covariances(path(job, tile), all);
  return all;
}

// Replaces C(w) by the empirical covariance; `ratio` is that of the block in the mean, where digits are lost.
void to_empirical(const BlockResult::Empirical& formal, double ratio, BlockResult::Empirical& scored) {
  const auto change = [&](const auto& all, auto& of_scores) {
    auto from = all.begin();
    for (auto& matrix : of_scores) matrix = empirical_covariance(*from++, matrix, ratio);
  };
  change(formal.frame_covariance, scored.frame_covariance);
  change(formal.aligned_covariance, scored.aligned_covariance);
  change(formal.camera_covariance, scored.camera_covariance);
  for (std::size_t r = 0; r < formal.mount_covariance.size(); ++r) {
    const RigIndex rig(static_cast<std::int64_t>(r));
    change(formal.mount_covariance[rig], scored.mount_covariance[rig]);
  }
  change(formal.control, scored.control);
  if (!formal.joint_covariance.frames.empty())
    scored.joint_covariance.matrix =
        empirical_covariance(formal.joint_covariance.matrix, scored.joint_covariance.matrix, ratio);
}

// Raises the empirical covariance of each camera to what whole images show of its parameters.
void inflate_cameras(const ImageSpread& spread, MergeOutcome& outcome) {
  for (CameraIndex c(0); outcome.empirical.camera_covariance.contains(c); ++c.value) {
    const Eigen::MatrixXd& formal = outcome.formal.camera_covariance[c];
    Eigen::MatrixXd& empirical = outcome.empirical.camera_covariance[c];
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < formal.rows(); ++k)
      if (formal(k, k) > 0) free.push_back(k);
    if (free.empty()) continue;
    const double reached = solve_symmetric(formal(free, free), empirical(free, free)).trace();
    empirical *= spread.camera_inflation(c.value, reached / static_cast<double>(free.size()));
  }
}

BlockResult::JointCovariance joint_covariance(const CovarianceMatrix& frames) {
  BlockResult::JointCovariance joint;
  for (const Unknown& frame : frames.unknowns) joint.frames.emplace_back(frame.id.index);
  const auto n = static_cast<Eigen::Index>(total_dimension(frames.unknowns));
  joint.matrix = Eigen::Map<const Eigen::MatrixXd>(frames.matrix.data(), n, n);
  return joint;
}

}  // namespace

std::string part_path(const Job& job, std::int64_t tile) {
  return job.store.path("merge/parts/" + std::to_string(tile) + ".bin");
}

std::string covariance_path(const Job& job, std::int64_t tile) {
  return job.store.path("merge/parts/" + std::to_string(tile) + ".covariances");
}

std::string scored_path(const Job& job, std::int64_t tile) {
  return job.store.path("merge/parts/" + std::to_string(tile) + ".scored");
}

void find_posterior(const Job& job, const MergeInputs& inputs, const std::vector<MotionReference>& references,
                    MergeTreeRunner& runner, Adjusted& adjusted) {
  std::filesystem::create_directories(job.store.path("merge/parts"));
  adjusted.parts.clear();
  adjusted.prior_tests = {};
  adjusted.posterior = runner.posterior([&](const RankTile& tile, const TileCovariance& covariance) {
    adjusted.prior_tests.add(prior_tests(tile, covariance));
    write_covariances(covariance_path(job, tile.tile), tile.problem, covariance);
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
  if (adjusted.posterior.gauge.free()) adjusted.prior_tests = {};
}

void find_empirical(const Job& job, MergeTreeRunner& runner, Adjusted& adjusted) {
  adjusted.scored_frames = runner.scored_posterior([&](const RankTile& tile, const TileCovariance& covariance) {
    write_covariances(scored_path(job, tile.tile), tile.problem, covariance);
  });
}

std::vector<TilePart> gather_parts(const Job& job, const Adjusted& adjusted, std::size_t tile_count) {
  return gather_by_tile(job.ranks, tile_count, adjusted.parts, [&](std::size_t i) { return adjusted.parts[i].tile; });
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

std::vector<std::string> judge_kept(const std::vector<TilePart>& parts) {
  constexpr std::int64_t kFewest = 100;  // observations that a tile needs to be judged
  constexpr std::size_t kLines = 3;
  double measured = 0, kept = 0;
  for (const TilePart& part : parts)
    measured += static_cast<double>(part.measured), kept += static_cast<double>(part.kept);
  const auto share = [](const TilePart& part) {
    return static_cast<double>(part.kept) / static_cast<double>(part.measured);
  };
  const auto share_of_others = [&](const TilePart& part) {
    const double others = measured - static_cast<double>(part.measured);
    return others > 0 ? (kept - static_cast<double>(part.kept)) / others : 0;
  };
  std::vector<const TilePart*> poor;
  for (const TilePart& part : parts)
    if (part.measured >= kFewest && share(part) < 0.5 * share_of_others(part)) poor.push_back(&part);
  std::ranges::stable_sort(poor, {}, [&](const TilePart* part) { return share(*part); });
  std::vector<std::string> lines;
  for (const TilePart* part : poor | std::views::take(kLines))
    lines.push_back(
        fmt::format("tile {} keeps few observations: {} of {} tie point observations ({:.0f} %), the others "
                    "{:.0f} %: most of its observations were rejected, and the others may agree by chance; check its "
                    "start poses and matches",
                    part->tile, part->kept, part->measured, 100 * share(*part), 100 * share_of_others(*part)));
  if (poor.size() > kLines)
    lines.push_back(std::to_string(poor.size() - kLines) + " more tiles that keep less than half of what others do");
  return lines;
}

MergeOutcome make_outcome(const Job& job, Adjusted& adjusted, const Tiles& tiles) {
  MergeOutcome outcome;
  outcome.state = std::move(adjusted.state);
  outcome.aside = adjusted.position.verdicts.get().aside;
  outcome.formal = read_covariances(job, tiles, outcome.state, covariance_path);
  outcome.formal.joint_covariance = joint_covariance(adjusted.posterior.frames);
  if (job.settings.merge.empirical_sigmas) {
    outcome.empirical = read_covariances(job, tiles, outcome.state, scored_path);
    outcome.empirical.joint_covariance = joint_covariance(adjusted.scored_frames);
    to_empirical(outcome.formal, cluster_weights(adjusted.posterior.spread).ratio, outcome.empirical);
    inflate_cameras(adjusted.posterior.spread, outcome);
  }
  const SubtreeSums& sums = adjusted.posterior.sums;
  outcome.chi2 = sums.weighted_squares;
  outcome.degrees_of_freedom =
      sums.residuals - sums.unknowns + static_cast<std::int64_t>(sums.held.size()) + sums.held_points;
  outcome.image_sigma_px = adjusted.image_sigma_px;
  outcome.global_iterations = adjusted.position.global.accepted;
  outcome.newton_decrement = std::sqrt(sums.decrement_squared);
  const BlockGauge& gauge = adjusted.posterior.gauge;
  if (!gauge.free()) {
    outcome.formal.aligned_covariance = {};
    outcome.empirical.aligned_covariance = {};
  }
  outcome.gauge = judge_gauge(sums, gauge, names_of(job.block)).text;
  for (const BlockComponent& part : gauge.components)
    if (!part.columns.empty()) {
      outcome.free_parts.push_back({FrameIndex(part.lowest_frame), static_cast<std::int32_t>(part.columns.size())});
      outcome.degrees_of_freedom += part.defect;  // a direction that only the datum fixes uses up no observations
    }
  outcome.seams = seam_checks(tiles.tree, adjusted.posterior);
  outcome.observations = adjusted.posterior.observations;
  for (std::size_t k = 0; k < kObservationKinds; ++k)
    outcome.observations.kinds[k].scale = adjusted.position.scales.of[k];
  const auto scales = adjusted.position.scales.of_groups();
  outcome.position_scales.assign(scales.begin(), scales.end());
  return outcome;
}

}  // namespace megablock
