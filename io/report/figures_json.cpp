#include "io/report/figures_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/evaluation/remarks/control_remarks.h"
#include "io/evaluation/receivers.h"
#include "io/report/sections/sections.h"

namespace megablock::report {

namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson number(double value) { return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr); }

OrderedJson vector(const Eigen::Vector3d& v) { return OrderedJson{number(v.x()), number(v.y()), number(v.z())}; }

OrderedJson histogram(const Histogram& h) { return {{"low", h.low}, {"width", h.width}, {"counts", h.bins}}; }

OrderedJson spread_of(const Spread& s) {
  return {{"median", number(s.median)}, {"p95", number(s.p95)}, {"largest", number(s.largest)}};
}

OrderedJson stages(const BlockResult& result) {
  OrderedJson list = OrderedJson::array();
  for (const StageStatistics& stage : result.stages)
    list.push_back({{"name", stage.name},
                    {"seconds", number(stage.seconds)},
                    {"peak_rss_mib", number(stage.peak_rss_mib)},
                    {"units", stage.units},
                    {"failed", stage.failed}});
  return list;
}

OrderedJson points(const BlockResult& result, const Figures& f) {
  OrderedJson list = OrderedJson::array();
  for (const PointResidual& r : f.points) {
    const ControlPoint& point = result.block.control_points[r.point];
    list.push_back({{"name", point.name},
                    {"role", point.role == PointRole::kCheck ? "check" : "control"},
                    {"difference_m", vector(r.difference)},
                    {"difference_sigma_m", vector(r.sigma)},
                    {"largest_over_sigma", number(r.ratio)},
                    {"images", r.images},
                    {"rms_px", number(r.rms_px)}});
  }
  return list;
}

OrderedJson failures(const BlockResult& result) {
  OrderedJson list = OrderedJson::array();
  for (const FailedUnit& failure : result.failures)
    list.push_back({{"stage", failure.stage}, {"unit", failure.unit}, {"reason", failure.reason}});
  return list;
}

OrderedJson cameras(const BlockResult& result) {
  OrderedJson list = OrderedJson::array();
  for (CameraIndex c(0); result.block.cameras.contains(c); ++c.value) {
    OrderedJson parameters;
    const CameraModel& model = result.block.cameras[c].intrinsics.model();
    for (int k = 0; k < parameter_count(model); ++k) {
      const auto at = static_cast<std::size_t>(k);
      const bool sigmas = result.camera_covariance.contains(c);
      parameters[parameter_name(model, k)] = {
          {"value", number(result.state.cameras.contains(c) ? result.state.cameras[c][at] : kUnknown)},
          {"sigma", number(sigmas ? std::sqrt(std::max(0.0, result.camera_covariance[c](k, k))) : kUnknown)}};
    }
    list.push_back({{"name", result.block.cameras[c].name}, {"model", model_name(model)}, {"parameters", parameters}});
    if (!result.block.cameras[c].choice.empty()) list.back()["choice"] = result.block.cameras[c].choice;
  }
  return list;
}

// The mounts of rigs with two or more cameras. Sigmas are along and about the axes of the rig.
OrderedJson mounts(const BlockResult& result) {
  OrderedJson list = OrderedJson::array();
  for (RigIndex r(0); result.block.rigs.contains(r) && result.state.mounts.contains(r); ++r.value) {
    const Rig& rig = result.block.rigs[r];
    if (rig.cameras().size() < 2) continue;
    for (std::size_t m = 0; m < rig.cameras().size(); ++m) {
      const Pose& pose = result.state.mounts[r][m];
      const Eigen::Quaterniond& q = pose.rotation;
      PoseIncrement sigma = PoseIncrement::Constant(kUnknown);
      if (result.mount_covariance.contains(r)) sigma = result.mount_covariance[r][m].diagonal().cwiseMax(0).cwiseSqrt();
      list.push_back({{"rig", rig.name},
                      {"mount", m},
                      {"camera", result.block.cameras[rig.mounts[m].camera].name},
                      {"position_m", vector(pose.centre)},
                      {"rotation_wxyz", {number(q.w()), number(q.x()), number(q.y()), number(q.z())}},
                      {"sigma_position_m", vector(sigma.tail<3>())},
                      {"sigma_rotation_rad", vector(sigma.head<3>())}});
    }
  }
  return list;
}

OrderedJson receivers(const BlockResult& result) {
  OrderedJson list = OrderedJson::array();
  for (const ReceiverFigures& receiver : receivers_of(result))
    list.push_back({{"rig", result.block.rigs[receiver.rig].name},
                    {"lever_arm_m", vector(receiver.lever_arm)},
                    {"sigma_lever_arm_m", vector(receiver.lever_arm_sigma)},
                    {"boresight_deg", vector(receiver.boresight)},
                    {"sigma_boresight_deg", vector(receiver.boresight_sigma)}});
  return list;
}

OrderedJson position_groups(const BlockResult& result) {
  OrderedJson list = OrderedJson::array();
  for (const ShiftFigures& group : shifts_of(result))
    list.push_back({{"group", result.block.rigs[group.group].name},
                    {"shift_m", vector(group.shift)},
                    {"sigma_shift_m", vector(group.sigma)},
                    {"sigma_scale_horizontal", number(group.scale.horizontal)},
                    {"sigma_scale_height", number(group.scale.height)}});
  return list;
}

}  // namespace

std::string figures_json(const BlockResult& result, const Figures& f) {
  std::vector<Eigen::Vector3d> differences;
  for (const PositionResidual& r : f.positions) differences.push_back(r.difference);
  OrderedJson json = {
      {"images", result.block.images.size()},
      {"oriented", f.reprojection.oriented_images},
      {"points", f.reprojection.points},
      {"observations", f.reprojection.observations},
      {"mean_reprojection_px", number(f.reprojection.mean_px)},
      {"rms_reprojection_px", number(f.reprojection.rms_px)},
      {"mean_track_length", number(f.reprojection.mean_track_length)},
      {"chi2_per_dof", result.degrees_of_freedom > 0 ? number(result.variance_factor) : OrderedJson(nullptr)},
      {"degrees_of_freedom", result.degrees_of_freedom},
      {"image_sigma_px", result.image_sigma_px},
      {"tiles", result.tiles.tile_count},
      {"components", f.components},
      {"boundary_frames", f.boundary_frames},
      {"global_iterations", result.global_iterations},
      {"newton_decrement", number(result.newton_decrement)},
      {"newton_decrement_limit", result.decrement_limit > 0 ? number(result.decrement_limit) : OrderedJson(nullptr)},
      {"program", result.provenance.program},
      {"arithmetic", result.provenance.arithmetic},
      {"parts", f.parts.size()},
      {"ground_resolution_m", number(f.ground_resolution_m)},
      {"gauge", result.gauge},
      {"digest", result.digest},
      {"gnss_frames", f.positions.size()},
      {"gnss_rms_m", vector(root_mean_square(differences))},
      {"sigma_east_m", spread_of(f.sigma_east)},
      {"sigma_north_m", spread_of(f.sigma_north)},
      {"sigma_up_m", spread_of(f.sigma_up)},
      {"sigma_rotation_rad", spread_of(f.sigma_rotation)},
      {"track_length", histogram(f.track_length)},
      {"intersection_angle_deg", histogram(f.intersection_deg)},
      {"residual_px", histogram(f.residual_px)},
      {"control_points", points(result, f)},
      {"control_points_unused", unused_points(result, PointRole::kControl).size()},
      {"check_points_unused", unused_points(result, PointRole::kCheck).size()},
      {"cameras", cameras(result)},
      {"mounts", mounts(result)},
      {"receivers", receivers(result)},
      {"position_groups", position_groups(result)},
      {"failures", failures(result)},
      {"stages", stages(result)},
      {"notes", result.notes}};
  // Names may contain any bytes. Those that are not UTF-8 are replaced, and '<' is escaped, so that no name can end the
  // script element.
  const std::string text = json.dump(1, ' ', false, OrderedJson::error_handler_t::replace);
  std::string safe;
  for (char c : text) safe += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return safe;
}

}  // namespace megablock::report
