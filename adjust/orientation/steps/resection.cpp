// The error of an observation is the angle between its ray and the direction of the point, so that all cameras of a rig
// and all camera models are treated alike.
#include "adjust/orientation/steps/resection.h"

#include <algorithm>

#include "geometry/estimation/ransac.h"
#include "geometry/resection/resection_estimators.h"

namespace megablock {

namespace {

std::vector<PointRay> point_rays_of(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                                    std::int32_t frame, const OrientationValues& values) {
  std::vector<PointRay> point_rays;
  for (std::size_t t = 0; t < values.points.size(); ++t)
    for (auto o = static_cast<std::size_t>(graph.begin[t]);
         values.points[t] && o < static_cast<std::size_t>(graph.begin[t + 1]); ++o) {
      const OrientationGraph::ImageNode& image = graph.images[row(graph.observations[o].image)];
      if (image.frame == frame && rays[o].squaredNorm() > 0)
        point_rays.push_back({image.mount.centre, image.mount.rotation.conjugate() * rays[o], *values.points[t]});
    }
  return point_rays;
}

}  // namespace

std::optional<Pose> resect_frame(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                                 std::int32_t frame, double max_error_rad, int min_points,
                                 const OrientationValues& values) {
  const std::vector<PointRay> point_rays = point_rays_of(graph, rays, frame, values);
  // A sample of three has several poses; a fourth point decides between them.
  if (static_cast<int>(point_rays.size()) < std::max(min_points, 4)) return std::nullopt;
  const ResectionEstimator estimator(point_rays);
  RansacOptions sampling;
  sampling.threshold = max_error_rad;
  sampling.confidence = 0.999;
  sampling.max_draws = 500;
  sampling.seed = static_cast<std::uint64_t>(frame) + 1;
  const auto found = ransac(estimator, sampling);
  if (!found) return std::nullopt;
  const Pose pose = estimator.adjusted(found->model, max_error_rad, 10);
  const int agreeing = consensus_of(estimator, pose, max_error_rad).count;
  if (agreeing < min_points || 4 * agreeing < static_cast<int>(point_rays.size())) return std::nullopt;
  return pose;
}

}  // namespace megablock
