// Registers a pair in iterations with falling thresholds. The thresholds are t_i = t_0 (t_n / t_0)^(i / m) for the
// first m = 3/4 of the iterations and t_n for the others, so that the last ones converge with a fixed test.
//
// A robust start must resect the pair C, D from the points of A and B. These points are far away compared with the base
// of A and B, and their errors along the rays are large. The resection weights every observation by the covariance of
// its point, without which the far points would decide. The approximate pose has a third of the largest admitted shift
// and turn as sigmas: a correct registration is then within three sigmas.
#include "adjust/registration/pair_registration.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>

#include "adjust/registration/four_frames.h"
#include "adjust/resection/rig_resection.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "geometry/similarity/similarity.h"
#include "io/base/error.h"

namespace megablock {

namespace {

std::vector<FourFrameTrack> seen_by_enough(const std::vector<FourFrameTrack>& tracks, int min_frames) {
  std::vector<FourFrameTrack> result;
  for (const FourFrameTrack& track : tracks) {
    unsigned frames = 0;
    for (const FourFrameTrack::View& view : track.views) frames |= 1u << view.frame;
    // A track must join the passes, and not only the two frames of one.
    if ((frames & 0b0011) != 0 && (frames & 0b1100) != 0 && std::popcount(frames) >= min_frames)
      result.push_back(track);
  }
  return result;
}

// The pose of C in the axes of A, by a resection of the rig of C and D from the points of A and B.
std::optional<Pose> resect_second_pair(const FourFrames& system, const std::vector<FourFrameTrack>& tracks,
                                       const PairRegistrationOptions& options, std::uint64_t seed) {
  const Pose d_in_c = relative_to(system.pose(2), system.pose(3));
  std::vector<ObservedPoint> observations;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const auto intersection = system.intersect(tracks[t], 0, 1, 1e3);
    if (!intersection) continue;
    for (const FourFrameTrack::View& view : tracks[t].views) {
      if (view.frame < 2) continue;
      ObservedPoint observation;
      // C and D are one rig: the rays of D are taken into the axes of C.
      observation.ray = view.frame == 2 ? view.ray : carried(view.ray, d_in_c);
      observation.point = intersection->point;
      // The base between A and B is not exact, which adds an error in proportion to the distance.
      const double base_error = 0.002 * intersection->point.norm();
      observation.covariance = intersection->covariance + base_error * base_error * Eigen::Matrix3d::Identity();
      observation.sigma_px = options.image_sigma_px;
      observation.id = static_cast<std::int64_t>(t);
      observations.push_back(observation);
    }
  }
  RigResectionOptions resection;
  resection.samples = options.samples;
  resection.min_points = 4;
  resection.min_share = 0.2;
  // Points of a street lie along it. The covariance decides whether they suffice; the adjustment of all four frames has
  // more observations than this start.
  resection.min_line_ratio = 0;
  resection.max_position_sigma_m = 1;
  try {
    const ApproximatePose trajectory{system.pose(2), options.max_shift_m / 3, options.max_turn_deg * kDegree / 3};
    return resect_rig(observations, resection, seed, trajectory).pose;
  } catch (const ComputeError&) {
    return std::nullopt;
  }
}

bool adjust(FourFrames& system, double first_threshold_px, const PairRegistrationOptions& options) {
  // The last quarter of the iterations has the last threshold.
  const int falling = std::max(1, options.iterations * 3 / 4);
  for (int i = 0; i < options.iterations; ++i) {
    const double part = std::min(1.0, static_cast<double>(i) / falling);
    if (!system.iterate(first_threshold_px * std::pow(options.last_threshold_px / first_threshold_px, part)))
      return false;
  }
  return true;
}

// Why the registration is refused; empty: it is accepted.
// The tests in their order: enough observations, enough of them, a fall of the residuals, a pose near the trajectory,
// and its precision.
std::string refusal(const PairRegistration& r, double turn_deg, const PairRegistrationOptions& options) {
  if (r.kept < options.min_measurements)
    return fmt::format("{} measurements stay, {} are needed", r.kept, options.min_measurements);
  if (r.kept < options.min_kept_share * r.measurements)
    return fmt::format("{} of {} measurements stay, a share of {:.2g} is needed", r.kept, r.measurements,
                       options.min_kept_share);
  if (!(r.median_after_px < r.median_before_px))
    return fmt::format("residuals do not fall: median {:.2f} px before, {:.2f} px after", r.median_before_px,
                       r.median_after_px);
  if (r.shift_m > options.max_shift_m || turn_deg > options.max_turn_deg)
    return fmt::format("{:.1f} m and {:.1f} degrees off the trajectory, at most {:.0f} m and {:.0f} degrees", r.shift_m,
                       turn_deg, options.max_shift_m, options.max_turn_deg);
  if (r.position_sigma_m > options.max_position_sigma_m || r.rotation_sigma_deg > options.max_rotation_sigma_deg)
    return fmt::format(
        "the points give the pose to {:.3f} m and {:.3f} degrees, {:.3f} m and {:.3f} degrees are needed",
        r.position_sigma_m, r.rotation_sigma_deg, options.max_position_sigma_m, options.max_rotation_sigma_deg);
  return {};
}

}  // namespace

void PairRegistrationOptions::check() const {
  if (iterations < 1) throw InputError("iterations must be at least 1");
  if (!(last_threshold_px > 0)) throw InputError("last_threshold_px must be positive");
  if (!(first_threshold_px >= last_threshold_px))
    throw InputError("first_threshold_px must not be below last_threshold_px");
  if (!(robust_threshold_px >= last_threshold_px))
    throw InputError("robust_threshold_px must not be below last_threshold_px");
  if (samples < 1) throw InputError("samples must be at least 1");
  if (!(image_sigma_px > 0)) throw InputError("image_sigma_px must be positive");
  if (!(pair_position_sigma_m >= 0) || !(pair_rotation_sigma_deg >= 0))
    throw InputError("pair_position_sigma_m and pair_rotation_sigma_deg must not be negative");
  if (min_frames < 3 || min_frames > 4) throw InputError("min_frames must be 3 or 4");
  if (min_tracks < 3) throw InputError("min_tracks must be at least 3");
  if (!(min_kept_share >= 0 && min_kept_share <= 1)) throw InputError("min_kept_share must be between 0 and 1");
  if (!(max_position_sigma_m > 0) || !(max_rotation_sigma_deg > 0) || !(max_shift_m > 0) || !(max_turn_deg > 0))
    throw InputError("max_position_sigma_m, max_rotation_sigma_deg, max_shift_m, max_turn_deg must be positive");
}

PairRegistration register_pair(const std::array<Pose, 4>& frames, const std::vector<FourFrameTrack>& all_tracks,
                               const PairRegistrationOptions& options, std::uint64_t seed) {
  const std::vector<FourFrameTrack> tracks = seen_by_enough(all_tracks, options.min_frames);
  PairRegistration result;
  result.tracks = static_cast<std::int32_t>(tracks.size());
  for (const FourFrameTrack& track : tracks) result.measurements += static_cast<std::int32_t>(track.views.size());
  if (result.tracks < options.min_tracks) {
    result.reason = fmt::format("{} points are seen in {} of the four frames, {} are needed", result.tracks,
                                options.min_frames, options.min_tracks);
    return result;
  }
  FourFrames system(frames, tracks, options);
  // The pose of C by the trajectory, from which shift and turn are measured.
  const Pose trajectory = system.pose(2);
  result.median_before_px = median(system.residuals());
  double threshold = options.first_threshold_px;
  if (options.robust_start)
    if (const auto start = resect_second_pair(system, tracks, options, seed)) {
      system.place_second_pair(*start);
      threshold = options.robust_threshold_px;
    }
  const bool adjusted = adjust(system, threshold, options);
  result.kept = system.kept();
  const auto covariance = adjusted ? system.covariance() : std::nullopt;
  if (!covariance) {
    result.reason = fmt::format("no common pose: {} of {} measurements agree", result.kept, result.measurements);
    return result;
  }
  result.relative = system.pose(2);
  result.median_after_px = median(system.kept_residuals());
  // Log(R Exp(w) R') = R w.
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Identity();
  turn.topLeftCorner<3, 3>() = result.relative.rotation.toRotationMatrix();
  result.covariance = turn * *covariance * turn.transpose();
  result.position_sigma_m = std::sqrt(result.covariance.bottomRightCorner<3, 3>().trace());
  result.rotation_sigma_deg = std::sqrt(result.covariance.topLeftCorner<3, 3>().trace()) / kDegree;
  result.shift_m = (result.relative.centre - trajectory.centre).norm();
  result.reason = refusal(result, rotation_angle(result.relative.rotation, trajectory.rotation) / kDegree, options);
  result.accepted = result.reason.empty();
  return result;
}

std::optional<Pose> register_3d_3d(const std::array<Pose, 4>& frames, const std::vector<FourFrameTrack>& all_tracks,
                                   std::uint64_t seed) {
  const std::vector<FourFrameTrack> tracks = seen_by_enough(all_tracks, 4);
  const FourFrames system(frames, tracks, {});
  std::vector<Eigen::Vector3d> first, second;  // the points in the axes of A, as intersected by each pair
  for (const FourFrameTrack& track : tracks) {
    const auto a = system.intersect(track, 0, 1, 1e3), c = system.intersect(track, 2, 3, 1e3);
    if (!a || !c) continue;
    first.push_back(a->point);
    second.push_back(c->point);
  }
  if (first.size() < 3) return std::nullopt;
  // A similarity fit decides which points are inliers; the scale is then set to one, because both pairs are metric.
  const auto fit = fit_similarity_robust(second, first, std::vector<double>(first.size(), 0.2), 300, seed);
  if (!fit) return std::nullopt;
  // The transformation about the centroid, without a scale.
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < first.size(); ++i) from += second[i], to += first[i];
  const double count = static_cast<double>(first.size());
  return Similarity{1, fit->rotation, to / count - fit->rotation * (from / count)}(system.pose(2));
}

}  // namespace megablock
