// The cost of a pose is
//
//     sum min(|r_i|^2, t^2) + |d|^2,
//
// with r_i the whitened residuals (observed_points.h), t = max_error_sigmas, and d the whitened difference from the
// approximate pose. A good residual of two numbers has |r| > 4 with the probability exp(-8) = 0.0003. The truncated
// cost is what RANSAC and the refinement have in common, so that a refined pose can be compared with a sample.
//
// Three points have up to eight poses, and points near a critical surface leave two poses with nearly equal residuals.
// The best sixteen samples are therefore all refined. Poses whose costs differ by less than nine are equally good: a
// difference of log-likelihoods of 4.5 is odds of 90. Two such poses at different places are refused.
#include "adjust/resection/rig_resection.h"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <set>

#include "geometry/estimation/ransac.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/line_ratio.h"
#include "io/base/error.h"

namespace megablock {

namespace {

using Approximate = std::optional<ApproximatePose>;

// The whitened difference from the approximate pose, as an increment: w of R = R_0 Exp(w), and C - C_0.
PoseIncrement departure(const Approximate& known, const Pose& pose) {
  PoseIncrement d = PoseIncrement::Zero();
  if (!known) return d;
  d << rotation_log<double>(known->pose.rotation.conjugate() * pose.rotation) / known->rotation_sigma_rad,
      (pose.centre - known->pose.centre) / known->position_sigma_m;
  return d;
}

// The truncated sum of squares of the observations.
double cost(std::span<const ObservedPoint> observations, const Pose& pose, double limit_squared) {
  const auto squares = ObservedPointEstimator(observations).squared_residuals(pose);
  double sum = 0;
  for (std::size_t i = 0; i < observations.size(); ++i) sum += std::min(limit_squared, squares(i));
  return sum;
}

PoseNormal normal_matrix(std::span<const ObservedPoint> observations, const Approximate& known, const Pose& pose,
                         double limit_squared, PoseIncrement& right) {
  PoseNormal normal = PoseNormal::Zero();
  right.setZero();
  if (known) {  // the rotation differs by a small angle, so that its derivative is nearly the identity
    PoseIncrement inverse_sigma;
    inverse_sigma << Eigen::Vector3d::Constant(1 / known->rotation_sigma_rad),
        Eigen::Vector3d::Constant(1 / known->position_sigma_m);
    normal = inverse_sigma.cwiseAbs2().asDiagonal();
    right = -inverse_sigma.cwiseProduct(departure(known, pose));
  }
  add_normal_equations(observations, pose, limit_squared, normal, right);
  return normal;
}

// Levenberg-Marquardt iterations on the truncated squares.
Pose refine(std::span<const ObservedPoint> observations, const Approximate& known, Pose pose, double limit_squared) {
  const auto value_at = [&](const Pose& p) {
    return cost(observations, p, limit_squared) + departure(known, p).squaredNorm();
  };
  // The damping begins nearly at Gauss-Newton, since the start is near.
  double damping = 1e-6, current = value_at(pose);
  for (int iteration = 0; iteration < 30 && damping < 1e6; ++iteration) {
    PoseIncrement right;
    PoseNormal normal = normal_matrix(observations, known, pose, limit_squared, right);
    normal.diagonal() *= 1 + damping;
    const PoseIncrement step = normal.ldlt().solve(right);
    if (!step.allFinite()) break;
    const Pose next = pose_update(pose, step);
    const double value = value_at(next);
    if (!(value <= current)) {
      damping = std::max(10 * damping, 1e-4);
      continue;
    }
    const bool done = step.norm() < 1e-10;
    pose = next, current = value, damping *= 0.1;
    if (done) break;
  }
  return pose;
}

struct Candidate {
  double cost;
  Pose pose;
};

// The poses with most inliers, the best first. They come from all samples of three where these are few, else from
// random ones.
std::vector<Pose> best_poses(std::span<const ObservedPoint> observations, const RigResectionOptions& options,
                             std::uint64_t seed) {
  RansacOptions sampling;
  sampling.threshold = options.max_error_sigmas;
  sampling.confidence = 0.9999;
  sampling.max_draws = options.samples;
  sampling.min_draws = std::min(10, options.samples);
  sampling.enumerate = options.samples;
  sampling.keep = 16;
  sampling.seed = seed;
  auto found = ransac(ObservedPointEstimator(observations), sampling);
  if (!found) return {};
  std::vector<Pose> poses = std::move(found->others);
  poses.insert(poses.begin(), found->model);
  return poses;
}

// Observations are counted by points: two cameras of a rig that see one point do not make two.
std::size_t distinct_points(std::span<const ObservedPoint> observations,
                            const std::vector<std::uint8_t>* agrees = nullptr) {
  std::set<std::int64_t> ids;
  for (std::size_t i = 0; i < observations.size(); ++i)
    if (!agrees || (*agrees)[i]) ids.insert(observations[i].id);
  return ids.size();
}

double line_ratio_of(std::span<const ObservedPoint> observations, const std::vector<std::uint8_t>& agrees) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < observations.size(); ++i)
    if (agrees[i]) points.push_back(observations[i].point);
  return line_ratio(points);
}

// The largest angle between two inlier points, seen from the rig. It is the smallest cosine.
double largest_angle_deg(std::span<const ObservedPoint> observations, const std::vector<std::uint8_t>& agrees,
                         const Pose& pose) {
  std::vector<Eigen::Vector3d> units;
  for (std::size_t i = 0; i < observations.size(); ++i)
    if (agrees[i]) units.push_back((observations[i].point - pose.centre).normalized());
  double smallest_cosine = 1;
  for (std::size_t i = 0; i < units.size(); ++i)
    for (std::size_t j = i + 1; j < units.size(); ++j)
      smallest_cosine = std::min(smallest_cosine, units[i].dot(units[j]));
  return std::acos(std::clamp(smallest_cosine, -1.0, 1.0)) / kDegree;
}

// The candidates that the observations cannot tell from the best one, refined, each of them once.
std::vector<Candidate> equally_good(std::span<const ObservedPoint> observations, const Approximate& known,
                                    const std::vector<Pose>& found, double limit_squared) {
  constexpr double kClear = 9;  // a pose whose sum of squares exceeds the smallest by more is worse
  std::vector<Candidate> refined;
  for (const Pose& start : found) {
    const Pose pose = refine(observations, known, start, limit_squared);
    refined.push_back({cost(observations, pose, limit_squared) + departure(known, pose).squaredNorm(), pose});
  }
  std::stable_sort(refined.begin(), refined.end(),
                   [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  std::vector<Candidate> distinct;
  for (const Candidate& candidate : refined) {
    if (candidate.cost > refined.front().cost + kClear) break;
    // Poses within 10 cm and 0.3 degrees are the same solution before its last iterations.
    const auto same = [&](const Candidate& other) {
      return (other.pose.centre - candidate.pose.centre).norm() < 0.1 &&
             rotation_angle(other.pose.rotation, candidate.pose.rotation) < 0.005;
    };
    if (std::none_of(distinct.begin(), distinct.end(), same)) distinct.push_back(candidate);
  }
  return distinct;
}

// Tests the pose: enough inlier points, not on one line, and a covariance within the bound. Fills in everything except
// the pose.
void assess(std::span<const ObservedPoint> observations, const Approximate& known, const RigResectionOptions& options,
            RigResection& result) {
  const double limit_squared = options.max_error_sigmas * options.max_error_sigmas;
  double squares = 0, count = 0;
  result.agrees.assign(observations.size(), 0);
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const auto w = whitened(observations[i], result.pose, false);
    if (!w || w->residual.squaredNorm() > limit_squared) continue;
    result.agrees[i] = 1;
    squares += w->squared_px, count += 2;
  }
  result.points = static_cast<int>(distinct_points(observations, &result.agrees));
  const auto all = static_cast<int>(distinct_points(observations));
  const int needed = std::max(options.min_points, static_cast<int>(std::ceil(options.min_share * all)));
  if (result.points < needed)
    throw ComputeError(
        fmt::format("only {} of {} points agree with one pose, {} are needed", result.points, all, needed));
  // The inliers may lie on a line although all points together do not.
  if (line_ratio_of(observations, result.agrees) < options.min_line_ratio)
    throw ComputeError("the points lie on one line, about which the rig could turn freely; measure one off the line");
  PoseIncrement right;
  const PoseNormal normal = normal_matrix(observations, known, result.pose, limit_squared, right);
  result.covariance = normal.ldlt().solve(PoseNormal::Identity());
  // Points near a critical surface pass every test of residuals; only the covariance shows them.
  const double sigma = std::sqrt(result.covariance.bottomRightCorner<3, 3>().trace());
  if (!(sigma <= options.max_position_sigma_m) || !(result.covariance.diagonal().array() >= 0).all())
    throw ComputeError(
        fmt::format("the points give the position to {:.2g} m only; measure points in other directions", sigma));
  result.rms_px = std::sqrt(squares / count);
  result.angle_deg = largest_angle_deg(observations, result.agrees, result.pose);
  if (result.angle_deg < options.warn_angle_deg)
    result.warnings.push_back(
        fmt::format("all points are seen within {:.0f} degrees (less than {:.0f}): the pose is weak", result.angle_deg,
                    options.warn_angle_deg));
}

}  // namespace

void RigResectionOptions::check() const {
  if (!(max_error_sigmas > 0)) throw InputError("max_error_sigmas must be positive");
  if (samples < 1) throw InputError("samples must be at least 1");
  if (!(min_share >= 0 && min_share <= 1)) throw InputError("min_share must be between 0 and 1");
  if (min_points < 3) throw InputError("min_points must be at least 3");
  if (!(min_line_ratio >= 0)) throw InputError("min_line_ratio must not be negative");
  if (!(max_position_sigma_m > 0)) throw InputError("max_position_sigma_m must be positive");
}

RigResection resect_rig(std::span<const ObservedPoint> observations, const RigResectionOptions& options,
                        std::uint64_t seed, const Approximate& known) {
  const std::size_t points = distinct_points(observations);
  if (points < 3) throw ComputeError(fmt::format("{} known points are seen, at least 3 are needed", points));
  const std::vector<std::uint8_t> all(observations.size(), 1);
  if (line_ratio_of(observations, all) < options.min_line_ratio)
    throw ComputeError("the points lie on one line, about which the rig could turn freely; measure one off the line");
  const double limit_squared = options.max_error_sigmas * options.max_error_sigmas;
  const std::vector<Pose> found = best_poses(observations, options, seed);
  if (found.empty()) throw ComputeError("no pose agrees with three of the points");
  const std::vector<Candidate> candidates = equally_good(observations, known, found, limit_squared);
  RigResection result;
  result.pose = candidates.front().pose;
  // A pose that is refused for its points or its precision has a better reason than the number of its rivals.
  assess(observations, known, options, result);
  if (candidates.size() > 1)
    throw ComputeError(
        fmt::format("{} poses agree with the points equally well; give an approximate pose or measure "
                    "another point",
                    candidates.size()));
  return result;
}

}  // namespace megablock
