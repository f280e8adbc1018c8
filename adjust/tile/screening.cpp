// Intersects and screens single points at held poses.
//
// A point is judged in three steps.
//
//     1. If all kept rays pass the threshold at the present point, the point stands. Every ray is tested there, so that
//        rejected rays that pass come back.
//     2. Otherwise the largest consistent set of all its rays is sought (consistent_rays.h), kept or rejected before.
//        It becomes the kept set, and its intersection the point.
//     3. A point whose kept rays meet below min_intersection_deg is left out, because its distance is open.
//
// The points do not depend on each other, because poses and cameras are held. Threads share them, and the result has
// the same bits for any number of threads.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "adjust/tile/consistent_rays.h"
#include "adjust/tile/tile_adjustment.h"
#include "geometry/intersection/triangulation.h"
#include "geometry/threads/workers.h"
#include "io/base/error.h"
#include "io/block/held_priors.h"

namespace megablock {

namespace {

constexpr double kGenerous = 1.5;  // times the threshold: limit for a point that stays where the adjustment put it
constexpr double kSettled = 1e-3;  // sigmas: this is exact enough, because an adjustment follows
const Eigen::Vector3d kNowhere = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());

class PointSettler {
 public:
  PointSettler(TileProblem& problem, TileState& state, double min_intersection_deg)
      : problem_(problem),
        state_(state),
        cos_min_angle_(std::cos(min_intersection_deg * std::numbers::pi / 180)),
        prior_(problem.points.size(), nullptr) {
    cameras_.reserve(problem.images.size());
    for (const TileImage& image : problem.images)
      cameras_.push_back(camera_pose(state.frames[image.frame.value], state.mounts[image.mount]));
    for (const auto& term : problem.point_priors) prior_[term.point.value] = &term;
  }

  // Intersects the kept rays, or the largest consistent set when they do not meet within the threshold.
  void intersect(std::int64_t p, double threshold) {
    load(p);
    const std::optional<Eigen::Vector3d> start = intersect_kept();
    if (start && passes_all_kept(*start, threshold)) {
      state_.points[p] = *start;
    } else if (!settle_by_parts(p, threshold)) {
      place_at_prior(p);
    }
    hold_out_narrow(p);
    store_kept();
  }

  void screen(std::int64_t p, double threshold) {
    load(p);
    const Eigen::Vector3d before = state_.points[p];
    const auto kept = std::count(kept_.begin(), kept_.end(), 1);
    // The prior of a control point replaces a ray.
    const bool enough = kept >= (prior_[p] ? 1 : 2);
    double longest = 0;  // longest residual of the rays kept before
    residuals_.clear();
    for (std::size_t i = 0; i < views_.size(); ++i) {
      residuals_.push_back(residual(i, before));
      if (kept_[i]) longest = std::max(longest, residuals_[i]);
    }
    if (enough && longest <= threshold) {
      for (std::size_t i = 0; i < views_.size(); ++i) kept_[i] = residuals_[i] <= threshold;
    } else if (!settle_by_parts(p, threshold)) {
      // A single ray has no set to be consistent with. It is tested against the position that the prior holds.
      if (prior_[p] && before.allFinite() && views_.size() == 1)
        test_against_prior(p, threshold);
      else
        std::fill(kept_.begin(), kept_.end(), 0);
    }
    hold_out_narrow(p);
    // If the same observations are kept, the point stays where the adjustment put it. The new point only lacks the
    // robust weights.
    if (before.allFinite() && same_verdicts() && longest <= kGenerous * threshold) state_.points[p] = before;
    store_kept();
  }

 private:
  // Loads the usable rows of a point, whose images have poses.
  void load(std::int64_t p) {
    rows_.clear();
    views_.clear();
    kept_.clear();
    for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
      const LocalImage local = problem_.image[row];
      if (!local.valid()) continue;
      const Pose& camera = cameras_[local.value];
      const Intrinsics& intrinsics = state_.cameras[problem_.images[local.value].camera.value];
      rows_.push_back(row);
      views_.push_back({camera, &intrinsics, {problem_.x[row], problem_.y[row]}, problem_.inverse_sigma[row]});
      kept_.push_back(problem_.kept[row]);
    }
  }
  bool same_verdicts() const {
    for (std::size_t i = 0; i < rows_.size(); ++i)
      if (kept_[i] != problem_.kept[rows_[i]]) return false;
    return true;
  }
  void store_kept() {
    for (std::size_t i = 0; i < rows_.size(); ++i) problem_.kept[rows_[i]] = kept_[i];
  }
  // Handles a point whose rays do not meet. A control point starts at its known position; others get no position.
  void place_at_prior(std::int64_t p) {
    const bool known = prior_[p] != nullptr && prior_[p]->sigma.allFinite();
    state_.points[p] = known ? prior_[p]->position : kNowhere;
    for (std::size_t i = 0; i < views_.size(); ++i)
      kept_[i] = known && kept_[i] && std::isfinite(residual(i, state_.points[p]));
  }

  double residual(std::size_t i, const Eigen::Vector3d& point) const { return residual_sigmas(views_[i], point); }
  bool passes_all_kept(const Eigen::Vector3d& point, double threshold) const {
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (kept_[i] && !(residual(i, point) <= threshold)) return false;
    return true;
  }

  // The least squares intersection of the kept rays, to a thousandth of a sigma.
  std::optional<Eigen::Vector3d> intersect_kept() const {
    std::vector<PointView> used;
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (kept_[i]) used.push_back(views_[i]);
    const auto refined = triangulate(used, kSettled);
    if (!refined) return std::nullopt;
    return refined->position;
  }

  // The largest consistent set of all rays, with its intersection as the point. False where no two rays agree.
  bool settle_by_parts(std::int64_t p, double threshold) {
    const auto part = find_consistent_rays(views_, threshold, static_cast<std::uint64_t>(problem_.points[p].index));
    if (!part) return false;
    kept_ = part->passing;
    state_.points[p] = part->point;
    return true;
  }

  // Tests the only ray of a control point against its coordinates, with the sigmas of both: r = x - f(P) has the
  // covariance C = sigma^2 I + J S J'. A ray that passes moves the point to the optimum of both, P + S J'C^-1 r.
  void test_against_prior(std::int64_t p, double threshold) {
    const TileProblem::PointTerm& term = *prior_[p];
    kept_[0] = residuals_[0] <= threshold;
    if (kept_[0] || !term.sigma.allFinite()) return;
    const PointView& view = views_[0];
    const ProjectionJacobian there = project_with_jacobian(*view.intrinsics, to_inside(view.camera, term.position));
    if (!there.valid) return;
    const Eigen::Vector2d r = view.inverse_sigma * pixel_difference(*view.intrinsics, view.pixel, there.pixel);
    const Eigen::Matrix<double, 2, 3> by_point =
        view.inverse_sigma * (there.by_point * view.camera.rotation.toRotationMatrix());
    const Eigen::Matrix<double, 3, 2> gain = term.sigma.cwiseAbs2().asDiagonal() * by_point.transpose();
    const Eigen::Vector2d solved = (Eigen::Matrix2d::Identity() + by_point * gain).inverse() * r;
    kept_[0] = r.dot(solved) <= threshold * threshold;
    if (kept_[0]) state_.points[p] = term.position + gain * solved;
  }

  // Rejects rays that meet at too small an angle, because they do not fix the distance of the point.
  void hold_out_narrow(std::int64_t p) {
    // A control point has its distance from its prior.
    if (prior_[p] == nullptr && !meet_wider_than(views_, kept_, state_.points[p], cos_min_angle_))
      std::fill(kept_.begin(), kept_.end(), 0);
  }

  TileProblem& problem_;
  TileState& state_;
  double cos_min_angle_;
  std::vector<const TileProblem::PointTerm*> prior_;  // [points], null for most
  std::vector<Pose> cameras_;
  // These belong to the present point.
  std::vector<std::int64_t> rows_;
  std::vector<PointView> views_;
  std::vector<std::uint8_t> kept_;
  std::vector<double> residuals_;  // sigmas
};

// The residuals, in sigmas of the images, that the attitude priors of frames with held positions allow: four sigmas of
// the worst attitude times the longest focal length. The poses of such frames are the priors themselves, so that an
// attitude error turns a whole image, and its rays miss each other by much more than an observation.
double allowed_by_attitudes(const TileProblem& problem, const TileState& state) {
  constexpr double kWide = 4;  // sigmas of the attitudes
  std::vector<std::uint8_t> placed(problem.frames.size(), 0);
  for (const auto& term : problem.positions) placed[term.frame.value] = held(term.prior);
  double turn = 0, focal = 0;
  for (const auto& term : problem.attitudes)
    if (placed[term.frame.value]) turn = std::max(turn, term.prior.sigma_rad.maxCoeff());
  for (const Intrinsics& camera : state.cameras) focal = std::max(focal, camera[kFocal]);
  return kWide * turn * focal / problem.image_sigma_px;
}

}  // namespace

namespace {

// Calls settle(PointSettler&, point) for each point. Points do not depend on each other.
template <typename Settle>
void settle_points(TileProblem& problem, TileState& state, const AdjustOptions& options, const Settle& settle) {
  // Points are given to threads in portions, so that the sharing costs nothing beside the work.
  constexpr std::int64_t kAtOnce = 1024;
  PerThread<PointSettler> settlers(
      [&] { return std::make_unique<PointSettler>(problem, state, options.min_intersection_deg); });
  visit_in_parallel((problem.point_count() + kAtOnce - 1) / kAtOnce, [&](std::int64_t part) {
    const std::int64_t end = std::min((part + 1) * kAtOnce, problem.point_count());
    for (std::int64_t p = part * kAtOnce; p < end; ++p) settle(settlers.mine(), p);
  });
}

}  // namespace

void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options) {
  triangulate_points(problem, state, options, std::vector<std::uint8_t>(problem.points.size(), 1));
}

void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options,
                        const std::vector<std::uint8_t>& which) {
  state.points.resize(problem.points.size(), kNowhere);
  constexpr double kAnything = 1e3;  // sigmas: only rays far away from the others are left out
  const double anything = std::max(kAnything, allowed_by_attitudes(problem, state));
  settle_points(problem, state, options, [&](PointSettler& settler, std::int64_t p) {
    if (which[p] && problem.active(p)) settler.intersect(p, anything);
  });
}

std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options) {
  return screen_observations(problem, state, threshold_sigmas, options,
                             std::vector<std::uint8_t>(problem.points.size(), 1));
}

std::int64_t screen_observations(TileProblem& problem, TileState& state, double threshold_sigmas,
                                 const AdjustOptions& options, const std::vector<std::uint8_t>& which) {
  if (!(threshold_sigmas > 0)) throw InputError("the screening threshold must be positive (sigmas)");
  const std::vector<std::uint8_t> before = problem.kept;
  settle_points(problem, state, options, [&](PointSettler& settler, std::int64_t p) {
    if (which[p]) settler.screen(p, threshold_sigmas);
  });
  std::int64_t changed = 0;
  for (std::size_t row = 0; row < before.size(); ++row) changed += before[row] != problem.kept[row];
  return changed;
}

}  // namespace megablock
