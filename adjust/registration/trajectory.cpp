// Links the frames of each pass to a chain. Successive frames i, j of a pass are linked by their stated relative pose
// (R_m, T), or, where there is none, by the difference of their start poses:
//
//     R_m = R_j R_i',   T = C_j - C_i  (in ground axes, in_ground)
//
// A relative pose that is stated in the other direction is inverted: relative_to(P, identity). A gap in time or place
// has no link: the difference of two poses on both sides of it is not what odometry observed.
#include "adjust/registration/trajectory.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "geometry/intersection/triangulation.h"
#include "geometry/numbers/angles.h"
#include "geometry/transform/pose.h"
#include "io/base/error.h"

namespace megablock {

namespace {

constexpr double kFree = 1e6;        // sigma of an unknown coordinate, metres
constexpr double kSamePlace = 1e-3;  // metres

using RelativeOf = std::map<std::pair<FrameIndex, FrameIndex>, const RelativePose*>;

// From position and attitude the centre is C = P - R'l, with l the lever arm in the axes of the rig.
std::optional<Pose> stated_pose(const Frame& frame) {
  if (frame.given_pose) return frame.given_pose;
  if (!frame.position_prior || !frame.attitude_prior) return std::nullopt;
  const Eigen::Quaterniond rotation = frame.attitude_prior->rotation_cw;
  return Pose{rotation, frame.position_prior->position - rotation.conjugate() * frame.position_prior->lever_arm};
}

// R_j = R_m R_i, C_j = C_i + R_i'T.
Pose carry_on(const Pose& from, const Pose& relative) {
  return {(relative.rotation * from.rotation).normalized(), from.centre + from.rotation.conjugate() * relative.centre};
}

// Throws InputError when some clock steps of a pass run against the others. It names a frame of the minority.
void check_clock(const Block& block, const std::vector<FrameIndex>& pass) {
  const auto run = [&](std::size_t i) {  // direction of the clock: 1 forwards, -1 backwards, 0 unknown or unchanged
    const double before = block.frames[pass[i - 1]].time_s, now = block.frames[pass[i]].time_s;
    return now > before ? 1 : now < before ? -1 : 0;
  };
  std::int64_t on = 0, back = 0;
  for (std::size_t i = 1; i < pass.size(); ++i) on += run(i) > 0, back += run(i) < 0;
  if (on == 0 || back == 0) return;
  for (std::size_t i = 1; i < pass.size(); ++i)
    if (run(i) == (on < back ? 1 : -1))
      throw InputError(fmt::format(
          "frame '{}': the clock of pass {} runs backwards from frame '{}' on; list the frames of a pass in the order "
          "of their times, or give passes of their own to frames of another clock",
          block.frames[pass[i]].name, block.frames[pass[i]].pass, block.frames[pass[i - 1]].name));
}

// The frames of each pass in their order.
std::map<std::int64_t, std::vector<FrameIndex>> passes_of(const Block& block) {
  std::map<std::int64_t, std::vector<FrameIndex>> passes;
  for (std::int64_t f = 0; f < std::ssize(block.frames); ++f)
    passes[block.frames[FrameIndex(f)].pass].push_back(FrameIndex(f));
  return passes;
}

// The relative pose of two successive frames. The block may state it in either direction, because a pass may be listed
// backwards.
std::optional<RelativePose> stated_link(FrameIndex from, FrameIndex to, const RelativeOf& relative) {
  if (const auto found = relative.find({from, to}); found != relative.end()) return *found->second;
  const auto found = relative.find({to, from});
  if (found == relative.end()) return std::nullopt;
  RelativePose turned = *found->second;
  turned.pose = relative_to(turned.pose, Pose{});
  return turned;
}

Pose start_of(const Block& block, FrameIndex f, const std::vector<Pose>& starts, FrameIndex before,
              const RelativeOf& relative) {
  const Frame& frame = block.frames[f];
  std::optional<Pose> pose = stated_pose(frame);
  if (!pose)
    if (const auto link = stated_link(before, f, relative))
      pose = carry_on(starts[static_cast<std::size_t>(before.value)], link->pose);
  if (!pose)
    throw InputError(
        fmt::format("frame '{}' has no pose in the trajectory; give an approximate pose, or position and "
                    "attitude",
                    frame.name));
  if (!pose->centre.allFinite() || !pose->rotation.coeffs().allFinite())
    throw InputError(fmt::format("frame '{}': its pose in the trajectory is not a number; remove the frame or its pose",
                                 frame.name));
  return *pose;
}

// Links two successive frames of a pass by their relative pose, else by the difference of their start poses, or reports
// a gap.
void add_link(const Block& block, FrameIndex from, FrameIndex to, const RelativeOf& relative,
              const TrajectoryOptions& options, Trajectory& trajectory) {
  if (const auto stated = stated_link(from, to, relative)) {
    const bool uniform = options.chain_position_sigma_m > 0;
    trajectory.input.chain.push_back({from, to, stated->pose,
                                      uniform ? options.chain_rotation_sigma_deg * kDegree : stated->rotation_sigma_rad,
                                      uniform ? options.chain_position_sigma_m : stated->position_sigma_m, false});
    return;
  }
  const Frame &first = block.frames[from], &second = block.frames[to];
  const Pose &a = trajectory.input.start[static_cast<std::size_t>(from.value)],
             &b = trajectory.input.start[static_cast<std::size_t>(to.value)];
  const double distance = (b.centre - a.centre).norm(), seconds = std::abs(second.time_s - first.time_s);
  if (distance > options.max_gap_m || seconds > options.max_gap_s) {
    trajectory.notes.push_back(fmt::format("gap of {:.0f} m{} between frames '{}' and '{}': not linked", distance,
                                           std::isfinite(seconds) ? fmt::format(" and {:.1f} s", seconds) : "",
                                           first.name, second.name));
    return;
  }
  // A copy would tie the chain to itself with no motion between. It is only reported: a vehicle may stand still.
  if (distance < kSamePlace && seconds == 0)
    trajectory.notes.push_back(fmt::format("frames '{}' and '{}' have the same time and place: is one of them a copy?",
                                           first.name, second.name));
  trajectory.input.chain.push_back({from,
                                    to,
                                    {(b.rotation * a.rotation.conjugate()).normalized(), b.centre - a.centre},
                                    options.difference_rotation_sigma_deg * kDegree,
                                    options.difference_position_sigma_m,
                                    true});
}

std::vector<Ray> rays_of(const PathPoint& point, const std::vector<Pose>& start) {
  std::vector<Ray> rays;
  for (const PathPoint::View& view : point.views) {
    const Pose& pose = start[static_cast<std::size_t>(view.frame.value)];
    rays.push_back(
        {pose.centre + pose.rotation.conjugate() * view.ray.origin, pose.rotation.conjugate() * view.ray.direction, 1});
  }
  return rays;
}

void add_points(const Block& block, const TrajectoryOptions& options, Trajectory& trajectory) {
  const auto named = [&](const ControlPoint& point) { return point.name.starts_with(options.check_prefix); };
  if (!options.check_prefix.empty() && std::none_of(block.control_points.begin(), block.control_points.end(), named))
    throw InputError("no control point's name begins with '" + options.check_prefix + "'");
  for (std::size_t i = 0; i < block.control_points.size(); ++i) {
    const ControlPoint& control = block.control_points[i];
    const bool held_out = !options.check_prefix.empty() && control.name.starts_with(options.check_prefix);
    PathPoint point;
    point.known = control.role == PointRole::kControl && !held_out;
    if (!point.known && options.check_points == TrajectoryOptions::CheckPoints::kIgnore) continue;
    for (const ImageMeasurement& m : control.measurements) {
      const auto ray =
          rig_ray(block.mount_of(m.image).pose, block.cameras[block.camera_of(m.image)].intrinsics, m.pixel);
      if (ray) point.views.push_back({block.images[m.image].frame, *ray, m.sigma_px});
    }
    const auto meeting = intersect_rays(rays_of(point, trajectory.input.start));
    // Known points start at their position; others at the intersection of their rays at the start poses.
    point.position = control.position;
    point.sigma = control.sigma;
    // A control point without a height takes it from the intersection of its rays, as a free unknown.
    if (point.known && std::isnan(control.position.z())) {
      if (!meeting) continue;
      point.position.z() = meeting->z();
      point.sigma.z() = kFree;
    }
    // A point whose position is not used needs two rays to have one.
    if (!point.known) {
      if (point.views.size() < 2 || !meeting) continue;
      point.position = *meeting;
    }
    if (point.views.empty()) continue;
    trajectory.input.points.push_back(std::move(point));
    trajectory.point_row.push_back(static_cast<std::int64_t>(i));
  }
}

}  // namespace

void TrajectoryOptions::check() const {
  if (!(chain_position_sigma_m >= 0) || !(chain_rotation_sigma_deg >= 0))
    throw InputError("chain_position_sigma_m and chain_rotation_sigma_deg must not be negative");
  if ((chain_position_sigma_m == 0) != (chain_rotation_sigma_deg == 0))
    throw InputError("chain_position_sigma_m and chain_rotation_sigma_deg are both zero or neither");
  if (!(difference_position_sigma_m > 0) || !(difference_rotation_sigma_deg > 0))
    throw InputError("difference_position_sigma_m and difference_rotation_sigma_deg must be positive");
  if (!(max_gap_m > 0) || !(max_gap_s > 0)) throw InputError("max_gap_m and max_gap_s must be positive");
}

Trajectory trajectory_of(const Block& block, const TrajectoryOptions& options) {
  RelativeOf relative;
  for (const RelativePose& r : block.relative_poses) relative[{r.from, r.to}] = &r;
  Trajectory trajectory;
  JointInput& input = trajectory.input;
  input.start.resize(block.frames.size());
  for (const Frame& frame : block.frames) {
    input.pass.push_back(frame.pass);
    input.located.push_back(frame.position_prior.has_value());
  }
  for (const auto& [pass, frames] : passes_of(block)) {
    check_clock(block, frames);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const FrameIndex before = i > 0 ? frames[i - 1] : FrameIndex();
      input.start[static_cast<std::size_t>(frames[i].value)] =
          start_of(block, frames[i], input.start, before, relative);
      if (i > 0) add_link(block, before, frames[i], relative, options, trajectory);
    }
  }
  if (options.use_control) add_points(block, options, trajectory);
  return trajectory;
}

}  // namespace megablock
