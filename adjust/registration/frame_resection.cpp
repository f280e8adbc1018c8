#include "adjust/registration/frame_resection.h"

#include <algorithm>
#include <map>

#include "io/base/error.h"

namespace megablock {

std::vector<FrameResection> resect_frames(const Block& block, const std::vector<Pose>& start,
                                          const TrajectoryOptions& which, const RigResectionOptions& options) {
  std::map<FrameIndex, std::vector<ObservedPoint>> observations;
  for (std::size_t i = 0; i < block.control_points.size(); ++i) {
    const ControlPoint& control = block.control_points[i];
    const bool held_out = !which.check_prefix.empty() && control.name.starts_with(which.check_prefix);
    // Check points must not act on what they check.
    if (control.role != PointRole::kControl || held_out || !control.position.allFinite()) continue;
    for (const ImageMeasurement& m : control.measurements) {
      const auto ray =
          rig_ray(block.mount_of(m.image).pose, block.cameras[block.camera_of(m.image)].intrinsics, m.pixel);
      if (!ray) continue;
      // The sigmas of a control point enter the whitening of its observations (observed_points.h).
      const Eigen::Matrix3d covariance = control.sigma.cwiseAbs2().asDiagonal();
      observations[block.images[m.image].frame].push_back(
          {*ray, control.position, covariance, m.sigma_px, static_cast<std::int64_t>(i)});
    }
  }
  std::vector<FrameResection> results;
  for (const auto& [frame, seen] : observations) {
    FrameResection result;
    result.frame = frame;
    std::vector<std::int64_t> points;
    for (const ObservedPoint& observation : seen) points.push_back(observation.id);
    // The rows are ascending, so that control points are in order.
    points.erase(std::unique(points.begin(), points.end()), points.end());
    result.points = static_cast<int>(points.size());
    std::optional<ApproximatePose> approximate;
    if (!start.empty()) approximate = ApproximatePose{start[static_cast<std::size_t>(frame.value)]};
    try {
      result.resection = resect_rig(seen, options, static_cast<std::uint64_t>(frame.value), approximate);
    } catch (const ComputeError& error) {
      result.refused = error.what();
    }
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace megablock
