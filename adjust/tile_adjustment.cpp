#include "adjust/tile_adjustment.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "adjust/image_sigma.h"
#include "adjust/linearise.h"
#include "adjust/lost_frames.h"
#include "io/error.h"

namespace megablock {

void AdjustOptions::check() const {
  observations.check();
  if (!(min_intersection_deg >= 0 && min_intersection_deg < 90))
    throw InputError("min_intersection_deg must lie in [0, 90)");
  if (!(max_residual_sigmas > 0)) throw InputError("max_residual_sigmas must be positive");
  if (screening_rounds < 1) throw InputError("screening_rounds must be at least 1");
  if (max_iterations < 1) throw InputError("max_iterations must be at least 1");
}

namespace {

// Sigma of the kept image residuals from their median (1.1774 is the median of a Rayleigh distribution), in a-priori
// sigmas: untouched by outliers.
double robust_sigma(const TileProblem& problem, const TileState& state) {
  const std::vector<ImageView> views = image_views(problem, state);
  std::vector<double> lengths;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!problem.active(p)) continue;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      if (!problem.kept[row]) continue;
      const Eigen::Vector2d difference =
          views[problem.image[row].value].difference_px(state.points[p], {problem.x[row], problem.y[row]});
      const double length = problem.inverse_sigma[row] * difference.norm();
      lengths.push_back(std::isfinite(length) ? length : std::numeric_limits<double>::max());
    }
  }
  if (lengths.empty()) throw ComputeError("the tile has no points that can be intersected");
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle / 1.1774;
}

// Mean redundancy of an image residual: least squares shortens residuals by its root.
double redundancy(const TileProblem& problem) {
  std::int64_t observations = 0, points = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!problem.active(p)) continue;
    ++points;
    observations += std::count(problem.kept.begin() + problem.begin[p], problem.kept.begin() + problem.begin[p + 1], 1);
  }
  const auto unknowns = static_cast<double>(3 * points + 6 * std::ssize(problem.frames));
  return std::clamp(1 - unknowns / static_cast<double>(2 * std::max<std::int64_t>(1, observations)), 0.25, 1.0);
}

// The a-priori sigma may be too small for the images at hand: thresholds follow the residuals upwards.
double threshold_factor(const TileProblem& problem, const TileState& state) {
  return std::max(1.0, robust_sigma(problem, state) / std::sqrt(redundancy(problem)));
}

class TileAdjuster {
 public:
  TileAdjuster(TileProblem& problem, TileState& state, const AdjustOptions& options, const TileSolver& solver)
      : problem_(problem), state_(state), options_(options), solver_(solver), images_(problem.cameras.size(), 0) {
    for (const TileImage& image : problem.images) ++images_[image.camera.value];
  }

  AdjustSummary run() {
    approach();
    recover();
    AdjustSummary summary;
    for (int round = 0; round + 1 < options_.screening_rounds; ++round) {
      // From 8 x to 1 x of the final threshold.
      const double left = 1 - static_cast<double>(round) / (options_.screening_rounds - 1);
      screen(options_.max_residual_sigmas * std::pow(8, left));
      solve_rough(Stage::kAll);
    }
    adopt_image_sigma();
    screen(options_.max_residual_sigmas);
    summary = solve_fine();
    // What the last solve moved across the threshold, or weighs otherwise.
    const bool reweighted = adopt_image_sigma();
    if (screen(options_.max_residual_sigmas) > problem_.observation_count() / 10000 || reweighted)
      summary = solve_fine();
    return count(summary);
  }

 private:
  enum class Stage { kFocal, kAll };

  // From rough start values to residuals of a few pixels: gross errors are left out, only focal length and k1 are
  // estimated, and of dense tiles only the longest tracks take part.
  void approach() {
    constexpr int kMaxRounds = 6;
    constexpr double kWide = 4;
    const std::vector<std::uint8_t> all = problem_.kept;
    select_long_tracks();
    triangulate_points(problem_, state_, options_);
    const std::vector<std::uint8_t> chosen = active_points();
    for (int round = 0; round < kMaxRounds; ++round) {
      const double sigma = robust_sigma(problem_, state_);
      screen_observations(problem_, state_, std::max(8 * options_.max_residual_sigmas, kWide * sigma), options_,
                          chosen);
      solve_rough(Stage::kFocal);
      const double next = robust_sigma(problem_, state_);
      if (next < 2 || next > 0.7 * sigma) break;
    }
    for (std::int64_t p = 0; p < problem_.point_count(); ++p)
      if (!chosen[p])
        std::copy(all.begin() + problem_.begin[p], all.begin() + problem_.begin[p + 1],
                  problem_.kept.begin() + problem_.begin[p]);
    triangulate_points(problem_, state_, options_);
  }

  // Frames that none of it has brought to their points; a few rounds, as they may hang on one another.
  void recover() {
    constexpr int kMaxRounds = 3;
    for (int round = 0; round < kMaxRounds; ++round) {
      screen(8 * options_.max_residual_sigmas);
      if (recover_lost_frames(problem_, state_, 8 * options_.max_residual_sigmas) == 0) return;
      screen(8 * options_.max_residual_sigmas);
      solve_rough(Stage::kFocal);
    }
  }

  // Enough tracks for each frame, the longest first, shared out among its images.
  void select_long_tracks() {
    constexpr std::int64_t kEnough = 200, kFewest = 20;  // of a frame, of an image
    std::vector<std::int64_t> images(problem_.frames.size(), 0);
    for (const TileImage& image : problem_.images) ++images[image.frame.value];
    std::vector<std::int64_t> enough;  // [images]
    for (const TileImage& image : problem_.images)
      enough.push_back(std::max(kFewest, kEnough / images[image.frame.value]));
    if (problem_.observation_count() < 2 * std::accumulate(enough.begin(), enough.end(), std::int64_t{0})) return;
    std::vector<std::int64_t> order(problem_.points.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) {
      return problem_.begin[a + 1] - problem_.begin[a] > problem_.begin[b + 1] - problem_.begin[b];
    });
    std::vector<std::int64_t> covered(problem_.images.size(), 0);
    for (std::int64_t p : order) {
      bool needed = problem_.points[p].role == PointRole::kControl;
      for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
        const std::int32_t image = problem_.image[row].value;
        needed = needed || (problem_.kept[row] && covered[image] < enough[image]);
      }
      for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
        if (!needed)
          problem_.kept[row] = 0;
        else if (problem_.kept[row])
          ++covered[problem_.image[row].value];
      }
    }
  }

  // Whether the weights have changed enough to matter.
  bool adopt_image_sigma() {
    constexpr double kSettled = 0.02;
    const double before = problem_.image_sigma_px;
    if (options_.estimate_image_sigma) estimate_image_sigma(problem_, state_, options_);
    return std::abs(problem_.image_sigma_px / before - 1) > kSettled;
  }

  std::vector<std::uint8_t> active_points() const {
    std::vector<std::uint8_t> result(problem_.points.size());
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) result[p] = problem_.active(p);
    return result;
  }

  std::int64_t screen(double threshold) {
    const std::vector<std::uint8_t> before = problem_.kept;
    const std::int64_t changed =
        screen_observations(problem_, state_, threshold * threshold_factor(problem_, state_), options_);
    for (std::size_t row = 0; row < before.size(); ++row) restored_ += !before[row] && problem_.kept[row];
    return changed;
  }

  // A few iterations with a loss that forgets gross errors and is as wide as the residuals are.
  void solve_rough(Stage stage) {
    constexpr int kIterations = 10;
    const RobustLoss loss = problem_.image_loss;
    problem_.image_loss = {RobustLoss::Kind::kCauchy, std::max(2.0, robust_sigma(problem_, state_))};
    solve({std::min(kIterations, options_.max_iterations), 1e-3, camera_free(stage)});
    problem_.image_loss = loss;
  }

  // To where another iteration would lower the cost by less than kResolved, a small fraction of a sigma.
  AdjustSummary solve_fine() {
    constexpr double kResolved = 0.01;
    const double cost = static_cast<double>(std::max<std::int64_t>(1, problem_.observation_count()));
    return solve({options_.max_iterations, std::min(1e-6, kResolved / cost), camera_free(Stage::kAll)});
  }

  AdjustSummary solve(const SolveOptions& solve_options) {
    const AdjustSummary summary = solver_(problem_, state_, solve_options);
    if (!summary.usable) throw ComputeError("the tile's adjustment does not converge: " + summary.text);
    return summary;
  }

  // Parameters estimated here: those of the stage that have a prior or enough images.
  std::vector<ParameterMask> camera_free(Stage stage) const {
    std::vector<ParameterMask> result = problem_.camera_free;
    for (std::size_t c = 0; c < result.size(); ++c) {
      for (int k = 0; k < state_.cameras[c].size(); ++k) {
        const ParameterRank rank = parameter_rank(state_.cameras[c].model(), k);
        const bool first = rank == ParameterRank::kLeading;
        const int needed = first                          ? options_.min_images_focal
                           : rank == ParameterRank::kHigh ? options_.min_images_radial3
                                                          : options_.min_images_principal;
        const bool wanted = stage == Stage::kAll || first;
        if (!wanted || (images_[c] < needed && !has_prior(c, k))) result[c] &= ~mask_of(k);
      }
    }
    return result;
  }
  bool has_prior(std::size_t camera, int parameter) const {
    for (const auto& term : problem_.intrinsic_priors)
      if (term.camera.value == static_cast<std::int32_t>(camera)) return intrinsic_prior_weight(term, parameter) > 0;
    return false;
  }

  AdjustSummary count(AdjustSummary summary) const {
    for (std::int64_t row = 0; row < problem_.observation_count(); ++row)
      if (problem_.image[row].valid()) summary.rejected += !problem_.kept[row];
    summary.restored = restored_;
    summary.text += fmt::format(", {} rejected", summary.rejected);
    return summary;
  }

  TileProblem& problem_;
  TileState& state_;
  const AdjustOptions& options_;
  const TileSolver& solver_;
  std::vector<std::int64_t> images_;  // of each camera
  std::int64_t restored_ = 0;
};

}  // namespace

double screening_threshold(const TileProblem& problem, const TileState& state, const AdjustOptions& options) {
  return options.max_residual_sigmas * threshold_factor(problem, state);
}

AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options,
                          const TileSolver& solver) {
  options.check();
  return TileAdjuster(problem, state, options, solver).run();
}

AdjustSummary adjust_tile(TileProblem& problem, TileState& state, const AdjustOptions& options) {
  return adjust_tile(problem, state, options, [](const TileProblem& p, TileState& s, const SolveOptions& o) {
    return solve_with_ceres(p, s, o);
  });
}

}  // namespace megablock
