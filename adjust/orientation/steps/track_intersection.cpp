// The error of a ray is the angle between it and the direction of the point. The cost of a proposed point is the
// truncated sum of min(angle^2, limit^2). A proposal is the midpoint of the shortest connection of two rays:
//
//     n = a x b,   d_a = (base x b)'n / n'n,   d_b = (base x a)'n / n'n,   both positive in front of the images.
//
// The point is then refined with the rays within the limit. The distance of the point from a ray, divided by its
// distance from the camera, is the angle, so that intersect_rays() with the weights 1 / distance^2 minimises angles.
#include "adjust/orientation/steps/track_intersection.h"

#include <algorithm>
#include <cmath>

#include "geometry/intersection/triangulation.h"

namespace megablock {

std::optional<Pose> OrientationValues::camera(const OrientationGraph& graph, std::int32_t image) const {
  const auto& node = graph.images[static_cast<std::size_t>(image)];
  const auto& frame = frames[static_cast<std::size_t>(node.frame)];
  if (!frame) return std::nullopt;
  return camera_pose(*frame, node.mount);
}

namespace {

struct TrackRays {
  std::vector<Ray> rays;
  std::vector<std::size_t> rows;  // of the observations
};

// atan2 of sine and cosine is exact for small angles and tells a point behind the camera, whose angle exceeds 90
// degrees.
double angle_from(const Ray& ray, const Eigen::Vector3d& point) {
  const Eigen::Vector3d to_point = point - ray.origin;
  return std::atan2(ray.direction.cross(to_point).norm(), ray.direction.dot(to_point));
}

// Midpoint of the shortest connection of two rays; empty when it is behind one of them.
std::optional<Eigen::Vector3d> midpoint(const Ray& a, const Ray& b) {
  const Eigen::Vector3d n = a.direction.cross(b.direction), base = b.origin - a.origin;
  const double n2 = n.squaredNorm();
  if (!(n2 > 1e-12)) return std::nullopt;
  const double da = base.cross(b.direction).dot(n) / n2, db = base.cross(a.direction).dot(n) / n2;
  if (!(da > 0 && db > 0)) return std::nullopt;
  return Eigen::Vector3d(0.5 * (a.origin + da * a.direction + b.origin + db * b.direction));
}

struct Hypothesis {
  Eigen::Vector3d point;
  std::size_t agreeing = 0;
  double cost = 0;
};

Hypothesis judge(const Eigen::Vector3d& point, const std::vector<Ray>& rays, double limit) {
  Hypothesis result{point};
  for (const Ray& ray : rays) {
    const double angle = angle_from(ray, point);
    result.agreeing += angle <= limit;
    result.cost += std::min(angle * angle, limit * limit);
  }
  return result;
}

std::optional<Hypothesis> best_pair(const std::vector<Ray>& rays, double limit) {
  constexpr int kMaxHypotheses = 30;
  const std::size_t count = rays.size();
  std::optional<Hypothesis> best;
  int tried = 0;
  // Rays far apart in the track come first, because they intersect best.
  for (std::size_t gap = count - 1; gap > 0 && tried < kMaxHypotheses; --gap)
    for (std::size_t i = 0; i + gap < count && tried < kMaxHypotheses; ++i) {
      const auto point = midpoint(rays[i], rays[i + gap]);
      if (!point) continue;
      ++tried;
      const Hypothesis candidate = judge(*point, rays, limit);
      if (!best || candidate.cost < best->cost) best = candidate;
    }
  return best;
}

// Least squares of the angles, which weights each ray by its inverse squared distance.
std::optional<Eigen::Vector3d> refine(Eigen::Vector3d point, const std::vector<Ray>& rays, double limit) {
  // The second iteration has the rays and the weights of the first point.
  for (int iteration = 0; iteration < 2; ++iteration) {
    std::vector<Ray> agreeing;
    for (const Ray& ray : rays)
      if (angle_from(ray, point) <= limit) {
        agreeing.push_back(ray);
        agreeing.back().weight = 1 / (point - ray.origin).squaredNorm();
      }
    const auto next = intersect_rays(agreeing);
    if (!next) return std::nullopt;
    point = *next;
  }
  return point;
}

std::optional<Eigen::Vector3d> intersect(const std::vector<Ray>& rays, const IntersectionLimits& limits) {
  if (rays.size() < 2) return std::nullopt;
  const auto start = best_pair(rays, limits.max_error_rad);
  if (!start || start->agreeing < 2) return std::nullopt;
  const auto point = refine(start->point, rays, limits.max_error_rad);
  if (!point) return std::nullopt;
  std::vector<Eigen::Vector3d> centres;
  for (const Ray& ray : rays)
    if (angle_from(ray, *point) <= limits.max_error_rad) centres.push_back(ray.origin);
  if (centres.size() < 2 || max_intersection_angle(*point, centres) < limits.min_intersection_rad) return std::nullopt;
  return point;
}

}  // namespace

void intersect_tracks(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                      const IntersectionLimits& limits, OrientationValues& values) {
  std::vector<std::optional<Pose>> cameras;
  for (std::size_t i = 0; i < graph.images.size(); ++i)
    cameras.push_back(values.camera(graph, static_cast<std::int32_t>(i)));
  // All points are found anew: an observation that was left out at worse poses comes back.
  values.points.assign(static_cast<std::size_t>(graph.track_count()), std::nullopt);
  values.kept.assign(graph.observations.size(), 0);
  TrackRays track;
  for (std::size_t t = 0; t < values.points.size(); ++t) {
    track.rays.clear();
    track.rows.clear();
    for (auto o = static_cast<std::size_t>(graph.begin[t]); o < static_cast<std::size_t>(graph.begin[t + 1]); ++o) {
      const auto& camera = cameras[static_cast<std::size_t>(graph.observations[o].image)];
      if (!camera || rays[o].squaredNorm() == 0) continue;
      track.rays.push_back({camera->centre, camera->rotation.conjugate() * rays[o]});
      track.rows.push_back(o);
    }
    values.points[t] = intersect(track.rays, limits);
    if (!values.points[t]) continue;
    for (std::size_t i = 0; i < track.rays.size(); ++i)
      values.kept[track.rows[i]] = angle_from(track.rays[i], *values.points[t]) <= limits.max_error_rad;
  }
}

}  // namespace megablock
