// Intersection and screening of single points at held poses.
//
// A point is settled as follows. When all kept rays pass the test at the current point, only rejected rays that pass
// as well come back. Otherwise every pair of rays (a fixed number of them for long tracks) proposes a point; the one
// with the least truncated cost sum min(r^2, t^2) is refined with the rays that pass, and these are kept: when the
// observations split into consistent parts, that is the larger part.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include "adjust/tile_adjustment.h"
#include "geometry/triangulation.h"
#include "io/error.h"

namespace megablock {

namespace {

constexpr int kMaxPairs = 36;  // all pairs of nine rays
constexpr double kGenerous =
    1.5;  // times the threshold: for points of two rays, which are less exact than those of all
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

  // Intersects the kept rays, or the largest consistent part when they do not meet within the threshold.
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
    const bool enough = kept >= (prior_[p] ? 1 : 2);
    if (enough && before.allFinite() && passes_all_kept(before, threshold)) {
      for (std::size_t i = 0; i < views_.size(); ++i) kept_[i] = residual(i, before) <= threshold;
    } else if (!settle_by_parts(p, threshold)) {
      if (prior_[p] && before.allFinite() && views_.size() == 1)
        kept_[0] = residual(0, before) <= threshold;
      else
        std::fill(kept_.begin(), kept_.end(), 0);
    }
    hold_out_narrow(p);
    // The same verdicts at a point a little aside (without the robust weights): it stays where the adjustment put it.
    if (before.allFinite() && same_verdicts() && passes_all_kept(before, kGenerous * threshold))
      state_.points[p] = before;
    store_kept();
  }

 private:
  // The usable rows of a point (their images have poses).
  void load(std::int64_t p) {
    rows_.clear();
    views_.clear();
    rays_.clear();
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
  // A point whose rays do not meet: a control point starts where it is known to be, others have no place.
  void place_at_prior(std::int64_t p) {
    const bool known = prior_[p] != nullptr && prior_[p]->sigma.allFinite();
    state_.points[p] = known ? prior_[p]->position : kNowhere;
    for (std::size_t i = 0; i < views_.size(); ++i)
      kept_[i] = known && kept_[i] && std::isfinite(residual(i, state_.points[p]));
  }

  // Length of the residual in sigmas; infinite behind the camera.
  double residual(std::size_t i, const Eigen::Vector3d& point) const {
    const PointView& view = views_[i];
    const double length =
        view.inverse_sigma * reprojection(*view.intrinsics, to_inside(view.camera, point), view.pixel).norm();
    return std::isfinite(length) ? length : std::numeric_limits<double>::infinity();
  }
  bool passes_all_kept(const Eigen::Vector3d& point, double threshold) const {
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (kept_[i] && !(residual(i, point) <= threshold)) return false;
    return true;
  }

  std::optional<Eigen::Vector3d> intersect_kept() const {
    std::vector<PointView> used;
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (kept_[i]) used.push_back(views_[i]);
    const auto refined = triangulate(used);
    if (!refined) return std::nullopt;
    return refined->position;
  }

  bool settle_by_parts(std::int64_t p, double threshold) {
    if (views_.size() < 2) return false;
    make_rays();
    Eigen::Vector3d best = kNowhere;
    double best_cost = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : pairs(p)) {
      if (!rays_[a] || !rays_[b]) continue;
      const std::array<Ray, 2> two{*rays_[a], *rays_[b]};
      const auto point = intersect_rays(two);
      if (!point) continue;
      const double cost = truncated_cost(*point, threshold);
      if (cost < best_cost) best_cost = cost, best = *point;
    }
    if (!best.allFinite()) return false;
    return keep_around(p, best, threshold);
  }

  // Refines with the rays that pass until they no longer change.
  bool keep_around(std::int64_t p, Eigen::Vector3d point, double threshold) {
    constexpr int kRounds = 4;
    std::vector<std::uint8_t> passing(views_.size()), before;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<PointView> used;
      for (std::size_t i = 0; i < views_.size(); ++i) {
        passing[i] = residual(i, point) <= (round == 0 ? kGenerous * threshold : threshold);
        if (passing[i]) used.push_back(views_[i]);
      }
      if (used.size() < 2) return false;
      if (round > 0 && passing == before) break;
      const auto refined = refine_point(point, used);
      if (!refined) return false;
      point = refined->position;
      before = passing;
    }
    for (std::size_t i = 0; i < views_.size(); ++i) passing[i] = passing[i] && residual(i, point) <= threshold;
    if (std::count(passing.begin(), passing.end(), 1) < 2) return false;
    kept_ = passing;
    state_.points[p] = point;
    return true;
  }

  void make_rays() {
    for (const PointView& view : views_) rays_.push_back(ground_ray(view.camera, *view.intrinsics, view.pixel));
  }

  double truncated_cost(const Eigen::Vector3d& point, double threshold) const {
    const double most = threshold * threshold;
    double sum = 0;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const double r = residual(i, point);
      sum += std::min(r * r, most);
    }
    return sum;
  }

  // All pairs of rays; of long tracks a fixed number, drawn with the point's own seed.
  std::vector<std::pair<std::size_t, std::size_t>> pairs(std::int64_t p) const {
    const std::size_t n = views_.size();
    std::vector<std::pair<std::size_t, std::size_t>> result;
    if (n * (n - 1) / 2 <= kMaxPairs) {
      for (std::size_t a = 0; a < n; ++a)
        for (std::size_t b = a + 1; b < n; ++b) result.emplace_back(a, b);
      return result;
    }
    std::mt19937_64 random(static_cast<std::uint64_t>(problem_.points[p].index));
    while (result.size() < kMaxPairs) {
      const std::size_t a = random() % n, b = random() % n;
      if (a != b) result.emplace_back(a, b);
    }
    return result;
  }

  // Rays that meet at too small an angle do not fix the distance of the point: it is held out.
  void hold_out_narrow(std::int64_t p) {
    if (prior_[p] != nullptr) return;
    std::vector<Eigen::Vector3d> directions;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      if (!kept_[i]) continue;
      const Eigen::Vector3d direction = (state_.points[p] - views_[i].camera.centre).normalized();
      for (const Eigen::Vector3d& other : directions)
        if (direction.dot(other) <= cos_min_angle_) return;
      directions.push_back(direction);
    }
    std::fill(kept_.begin(), kept_.end(), 0);
  }

  TileProblem& problem_;
  TileState& state_;
  double cos_min_angle_;
  std::vector<const TileProblem::PointTerm*> prior_;  // [points], null for most
  std::vector<Pose> cameras_;
  // Of the point at hand:
  std::vector<std::int64_t> rows_;
  std::vector<PointView> views_;
  std::vector<std::optional<Ray>> rays_;
  std::vector<std::uint8_t> kept_;
};

}  // namespace

void triangulate_points(TileProblem& problem, TileState& state, const AdjustOptions& options) {
  state.points.resize(problem.points.size(), kNowhere);
  constexpr double kAnything = 1e3;  // sigmas: only rays that have nothing to do with the others are left out
  PointSettler settler(problem, state, options.min_intersection_deg);
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (problem.active(p)) settler.intersect(p, kAnything);
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
  PointSettler settler(problem, state, options.min_intersection_deg);
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (which[p]) settler.screen(p, threshold_sigmas);
  std::int64_t changed = 0;
  for (std::size_t row = 0; row < before.size(); ++row) changed += before[row] != problem.kept[row];
  return changed;
}

}  // namespace megablock
