#include "cluster/stages/merge/assemble_result.h"

#include <algorithm>
#include <limits>
#include <unordered_set>
#include <utility>

#include "cluster/job/stage.h"
#include "cluster/stages/result/provenance.h"

namespace megablock {

namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

void append_control(BlockResult& result, const std::vector<TilePart>& parts) {
  const Eigen::Vector3d unknown = Eigen::Vector3d::Constant(kUnknown);
  for (const ControlPoint& point : result.block.control_points)
    result.control.push_back(
        {unknown, Eigen::Matrix3d::Constant(kUnknown),
         std::vector<Eigen::Vector2d>(point.measurements.size(), Eigen::Vector2d::Constant(kUnknown)),
         std::vector<std::uint8_t>(point.measurements.size(), 0)});
  for (const TilePart& part : parts)
    for (std::size_t i = 0; i < part.control.size(); ++i) {
      const BlockResult::ControlResult& from = part.control[i];
      BlockResult::ControlResult& to = result.control[static_cast<std::size_t>(part.control_rows[i])];
      to.adjusted = from.adjusted;
      to.covariance = from.covariance;
      const auto rows = static_cast<std::ptrdiff_t>(std::min(from.residual_px.size(), to.residual_px.size()));
      std::copy_n(from.residual_px.begin(), rows, to.residual_px.begin());
      std::copy_n(from.kept.begin(), rows, to.kept.begin());
      auto& measurements = result.block.control_points[static_cast<std::size_t>(part.control_rows[i])].measurements;
      for (std::size_t k = 0; k < measurements.size(); ++k) measurements[k].pixel = part.control_measured[i][k];
    }
}

void find_boundary(BlockResult& result, const std::vector<TilePart>& parts) {
  IndexedVector<FrameIndex, int> touched(result.block.frames.size(), 0);
  for (const TilePart& part : parts)
    for (const FrameIndex frame : part.frames) ++touched[frame];
  for (const int count : touched) result.boundary.push_back(count > 1 ? 1 : 0);
}

// Lists the images without a pose, each with its reason.
void list_failures(const JobRecord& record, const std::map<FrameIndex, std::string>& not_oriented,
                   BlockResult& result) {
  result.failures = record.failures;
  std::unordered_set<std::string> told;
  for (const FailedUnit& failure : record.failures) told.insert(failure.unit);
  for (std::size_t i = 0; i < result.block.images.size(); ++i) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const FrameIndex frame = result.block.images[image].frame;
    if (result.state.oriented[frame]) continue;
    const std::string name = result.block.name_of(image);
    if (told.contains(name)) continue;
    const auto reason = not_oriented.find(frame);
    const bool linked = result.tiles.tile_of_frame.contains(frame) && result.tiles.tile_of_frame[frame].valid();
    result.failures.push_back({linked ? kOrientationStage : kMatchingStage, name,
                               linked && reason != not_oriented.end() ? reason->second
                               : linked ? "oriented at first, but too few of its observations hold in the adjustment"
                                        : "no other image shares enough verified matches with it"});
  }
}

void scale_covariances(BlockResult& result, double factor) {
  for (auto& covariance : result.frame_covariance) covariance *= factor;
  for (auto& covariance : result.aligned_covariance) covariance *= factor;
  result.joint_covariance.matrix *= factor;
  for (auto& covariance : result.camera_covariance) covariance *= factor;
  for (auto& rig : result.mount_covariance)
    for (auto& covariance : rig) covariance *= factor;
  for (auto& control : result.control) control.covariance *= factor;
  result.sigma_scaled = true;
}

}  // namespace

BlockResult assemble_result(const Job& job, const JobRecord& record, Block& block, const Tiles& tiles,
                            const std::map<FrameIndex, std::string>& not_oriented, MergeOutcome outcome,
                            const std::vector<TilePart>& parts) {
  BlockResult result;
  result.image_records = image_records(job, record);
  result.provenance = provenance_of(job);
  result.block = std::exchange(block, {});
  result.state = std::move(outcome.state);
  result.tiles = tiles;
  result.frame_covariance = std::move(outcome.formal.frame_covariance);
  result.aligned_covariance = std::move(outcome.formal.aligned_covariance);
  result.joint_covariance = std::move(outcome.formal.joint_covariance);
  result.camera_covariance = std::move(outcome.formal.camera_covariance);
  result.mount_covariance = std::move(outcome.formal.mount_covariance);
  result.empirical = std::move(outcome.empirical);
  append_control(result, parts);
  std::ranges::sort(outcome.aside);
  for (const PriorId& prior : outcome.aside)
    if (prior.is_control)
      result.control_aside.push_back(prior.row);
    else
      result.positions_aside.emplace_back(prior.row);
  find_boundary(result, parts);
  result.chi2 = outcome.chi2;
  result.degrees_of_freedom = outcome.degrees_of_freedom;
  result.variance_factor = outcome.variance_factor();
  if (job.settings.merge.scale_sigma) scale_covariances(result, result.variance_factor);
  result.image_sigma_px = outcome.image_sigma_px;
  result.global_iterations = outcome.global_iterations;
  result.newton_decrement = outcome.newton_decrement;
  result.decrement_limit = job.settings.merge.decrement;
  result.free_parts = outcome.free_parts;
  result.gauge = outcome.gauge;
  result.seams = outcome.seams;
  result.observation_table = outcome.observations;
  result.position_scales = std::move(outcome.position_scales);
  result.notes = record.notes;
  list_failures(record, not_oriented, result);
  return result;
}

}  // namespace megablock
