#include "adjust/resection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "geometry/p3p.h"

namespace megablock {

namespace {

// A ray of the frame and the point it should meet.
struct Sight {
  std::int32_t image;
  Eigen::Vector3d ray, point;
};

std::vector<Sight> sights_of(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                             std::int32_t frame, const OrientationValues& values) {
  std::vector<Sight> sights;
  for (std::size_t t = 0; t < values.points.size(); ++t)
    for (auto o = static_cast<std::size_t>(graph.begin[t]);
         values.points[t] && o < static_cast<std::size_t>(graph.begin[t + 1]); ++o) {
      const std::int32_t image = graph.observations[o].image;
      if (graph.images[static_cast<std::size_t>(image)].frame == frame && rays[o].squaredNorm() > 0)
        sights.push_back({image, rays[o], *values.points[t]});
    }
  std::stable_sort(sights.begin(), sights.end(), [](const Sight& a, const Sight& b) { return a.image < b.image; });
  return sights;
}

const Pose& mount_of(const OrientationGraph& graph, const Sight& sight) {
  return graph.images[static_cast<std::size_t>(sight.image)].mount;
}

double chord(const OrientationGraph& graph, const Pose& frame, const Sight& sight) {
  return (to_camera(frame, mount_of(graph, sight), sight.point).normalized() - sight.ray).norm();
}

double cost(const OrientationGraph& graph, const Pose& frame, const std::vector<Sight>& sights, double limit) {
  double sum = 0;
  for (const Sight& sight : sights) sum += std::min(1.0, std::pow(chord(graph, frame, sight) / limit, 2));
  return sum;
}

// Gauss-Newton on the chords between rays and directions to the points, Cauchy weights.
Pose refine(const OrientationGraph& graph, Pose frame, const std::vector<Sight>& sights, double limit) {
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Sight& sight : sights) {
      const Pose& mount = mount_of(graph, sight);
      const Eigen::Vector3d difference = sight.point - frame.centre;
      const Eigen::Vector3d in_camera = to_camera(frame, mount, sight.point);
      const double distance = in_camera.norm();
      const Eigen::Vector3d unit = in_camera / distance, residual = unit - sight.ray;
      if (residual.norm() > 2 * limit) continue;
      const Eigen::Matrix3d rotation = (mount.rotation * frame.rotation).toRotationMatrix();
      const Eigen::Matrix3d by_centre = -(Eigen::Matrix3d::Identity() - unit * unit.transpose()) / distance * rotation;
      Eigen::Matrix<double, 3, 6> jacobian;
      jacobian << by_centre * skew<double>(difference), by_centre;
      const double weight = 1 / (1 + 4 * residual.squaredNorm() / (limit * limit));
      normal += weight * jacobian.transpose() * jacobian;
      right -= weight * jacobian.transpose() * residual;
    }
    const PoseIncrement step = normal.ldlt().solve(right);
    if (!step.allFinite()) break;
    const Pose next = pose_update(frame, step);
    if (cost(graph, next, sights, limit) > cost(graph, frame, sights, limit)) break;
    frame = next;
  }
  return frame;
}

}  // namespace

std::optional<Pose> resect_frame(const OrientationGraph& graph, const std::vector<Eigen::Vector3d>& rays,
                                 std::int32_t frame, double max_error_rad, int min_points,
                                 const OrientationValues& values) {
  const std::vector<Sight> sights = sights_of(graph, rays, frame, values);
  if (static_cast<int>(sights.size()) < std::max(min_points, 4)) return std::nullopt;
  std::mt19937_64 random(static_cast<std::uint64_t>(frame) + 1);
  constexpr int kSamples = 300;
  std::optional<Pose> best;
  double best_cost = 0;
  for (int sample = 0; sample < kSamples; ++sample) {
    const std::size_t first = random() % sights.size();
    const auto same = [&](const Sight& s) { return s.image == sights[first].image; };
    const auto begin = std::find_if(sights.begin(), sights.end(), same);
    const auto count = static_cast<std::size_t>(std::count_if(begin, sights.end(), same));
    std::array<Eigen::Vector3d, 3> sample_rays, sample_points;
    for (std::size_t k = 0; k < 3; ++k) {
      const Sight& s = begin[static_cast<std::ptrdiff_t>(random() % count)];
      sample_rays[k] = s.ray;
      sample_points[k] = s.point;
    }
    const Pose& mount = mount_of(graph, sights[first]);
    for (const Pose& camera : solve_p3p(sample_rays, sample_points)) {
      const Eigen::Quaterniond rotation = (mount.rotation.conjugate() * camera.rotation).normalized();
      const Pose candidate{rotation, camera.centre - rotation.conjugate() * mount.centre};
      const double candidate_cost = cost(graph, candidate, sights, max_error_rad);
      if (!best || candidate_cost < best_cost) best = candidate, best_cost = candidate_cost;
    }
  }
  if (!best) return std::nullopt;
  *best = refine(graph, *best, sights, max_error_rad);
  const auto agreeing = std::count_if(sights.begin(), sights.end(),
                                      [&](const Sight& s) { return chord(graph, *best, s) <= max_error_rad; });
  if (agreeing < min_points || 4 * agreeing < static_cast<std::ptrdiff_t>(sights.size())) return std::nullopt;
  return best;
}

}  // namespace megablock
