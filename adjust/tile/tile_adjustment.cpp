// Adjusts one tile, in the order of run():
//
//     approach()   from start values to residuals of a few pixels, with a loss that forgets
//     recover()    parts and frames that still stand apart are put back
//     screening    every observation is tested, kept or rejected, with falling thresholds; a rough solution follows
//     solve_fine() the solution with the losses of the problem, and once more where the last test changed much
//
// The test. |r|, the length of the residual of an image observation in sigmas, has a Rayleigh distribution where the
// a-priori sigma is right: P(|r| > t) = exp(-t^2 / 2), with the median sqrt(2 ln 2) = 1.1774. The final threshold of 4
// sigmas thus rejects 3 good observations of 10 000. The thresholds fall geometrically from 8 times that:
//
//     t_i = 8^(1 - i / (n - 1)) max_residual_sigmas,   i = 0 .. n - 1,   n = screening_rounds
//
// The a-priori sigma is a guess. Thresholds are multiplied by max(1, s / sqrt(q)), where s is the median residual over
// 1.1774, and q the mean redundancy of an observation: the residuals of an adjustment are shorter than the errors by
// sqrt(q). A factor below one is not taken, so that a tile of very good observations does not reject the tails of its
// own distribution.
//
// Tolerances. A Newton step lowers the cost F = 1/2 sum |r|^2 by half its squared length in sigmas of the unknowns. F
// is about the number of image observations, because each has two numbers with a mean square of one. To stop where a
// step moves every one of n frame unknowns by k of its sigmas, an iteration must end when it lowers the cost by less
// than the share 1/2 k^2 n / observations.
#include "adjust/tile/tile_adjustment.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "adjust/problem/long_tracks.h"
#include "adjust/terms/linearise.h"
#include "adjust/tile/image_sigma.h"
#include "adjust/tile/lost_frames.h"
#include "adjust/tile/lost_parts.h"
#include "adjust/tile/prior_scales.h"
#include "io/base/error.h"
#include "io/text/plausible.h"

namespace megablock {

void AdjustOptions::check() const {
  observations.check();
  if (!(min_intersection_deg >= 0 && min_intersection_deg < 90))
    throw InputError("min_intersection_deg must lie in [0, 90)");
  require_within(max_residual_sigmas, kInSigmas, "max_residual_sigmas");
  if (screening_rounds < 1) throw InputError("screening_rounds must be at least 1");
  if (max_iterations < 1) throw InputError("max_iterations must be at least 1");
}

namespace {

// The lengths of kept image residuals, in a-priori sigmas. Of many points only every n-th is used.
std::vector<double> residual_lengths(const TileProblem& problem, const TileState& state) {
  // The median of a sample is good enough to set a threshold. The sample is every n-th point, so that it is the same in
  // every run.
  constexpr std::int64_t kEnough = 20'000;  // points
  const std::int64_t stride = std::max<std::int64_t>(1, problem.point_count() / kEnough);
  const std::vector<ImageView> views = image_views(problem, state);
  std::vector<double> lengths;
  for (std::int64_t p = 0; p < problem.point_count(); p += stride) {
    if (!problem.active(p)) continue;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      if (!problem.kept[row]) continue;
      const Eigen::Vector2d difference =
          views[problem.image[row].value].difference_px(state.points[p], {problem.x[row], problem.y[row]});
      const double length = problem.inverse_sigma[row] * difference.norm();
      lengths.push_back(std::isfinite(length) ? length : std::numeric_limits<double>::max());
    }
  }
  return lengths;
}

// The sigma of the kept image residuals, in a-priori sigmas. It comes from their median (1.1774 is the median of a
// Rayleigh distribution), so that outliers do not affect it.
double robust_sigma(std::vector<double> lengths, const AdjustOptions& options) {
  if (lengths.empty())
    throw ComputeError(
        fmt::format("the tile has no points that can be intersected: the rays of none meet in front of their images at "
                    "adjustment.min_intersection_deg = {} or more; lower it where all rays are nearly parallel, as "
                    "satellites' are, "
                    "else check the start poses and cameras",
                    options.min_intersection_deg));
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle / 1.1774;
}
double robust_sigma(const TileProblem& problem, const TileState& state, const AdjustOptions& options) {
  return robust_sigma(residual_lengths(problem, state), options);
}

// The mean redundancy q of a number of an image observation: one minus unknowns over observed numbers. The residuals of
// least squares are shorter than the errors by sqrt(q). Cameras and mounts are left out: they are few. The lower bound
// keeps the threshold of a hardly redundant tile within twice the usual one.
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

// The a-priori sigma may be too small for these images. The thresholds then grow with the residuals.
double threshold_factor(const TileProblem& problem, double robust_sigma) {
  return std::max(1.0, robust_sigma / std::sqrt(redundancy(problem)));
}
double threshold_factor(const TileProblem& problem, const TileState& state, const AdjustOptions& options) {
  return threshold_factor(problem, robust_sigma(problem, state, options));
}

class TileAdjuster {
 public:
  TileAdjuster(TileProblem& problem, TileState& state, const AdjustOptions& options, const TileSolver& solver)
      : problem_(problem), state_(state), options_(options), solver_(solver), images_(problem.cameras.size(), 0) {
    for (const TileImage& image : problem.images) ++images_[image.camera.value];
  }

  AdjustSummary run() {
    if (options_.only_start) set_losses_from_afar(problem_, options_.observations);
    approach();
    recover();
    for (int round = 0; round + 1 < options_.screening_rounds; ++round) {
      // From 8 times to once the final threshold.
      const double left = 1 - static_cast<double>(round) / (options_.screening_rounds - 1);
      screen(options_.max_residual_sigmas * std::pow(8, left));
      // When the rough solutions fit already, further rounds with wider thresholds change no verdict, and the fine
      // solution follows at once.
      if (fits()) break;
      chosen_.assign(chosen_.size(), 1);
      solve_rough(Stage::kAll);
    }
    adopt_image_sigma();
    screen(options_.max_residual_sigmas);
    AdjustSummary summary = solve_fine();
    // Observations that the last solution has moved across the threshold, or that now have another weight.
    const bool reweighted = adopt_image_sigma();
    if (screen(options_.max_residual_sigmas) > problem_.observation_count() / (options_.only_start ? 1000 : 10000) ||
        reweighted)
      summary = solve_fine();
    return count(summary);
  }

 private:
  enum class Stage { kFocal, kAll };
  static constexpr double kApart = 3;  // times the widest limit, for passes that start apart

  // Goes from rough start values to residuals of a few pixels. Gross errors are left out, and only focal length and k1
  // are estimated. In a dense tile only the longest tracks take part, until they are consistent.
  void approach() {
    constexpr int kMaxRounds = 6;
    constexpr double kWide = 4;
    constexpr int kFew = 6;  // iterations: testing the rays again helps more than further iterations
    const std::vector<std::uint8_t> all = problem_.kept;
    const bool dense = choose_long_tracks(problem_);
    // In a dense tile the limit must include the observations that connect passes which start apart. With few tracks it
    // would then include too many gross errors.
    const double widest = 8 * options_.max_residual_sigmas * (dense ? kApart : 1);
    triangulate_points(problem_, state_, options_);
    chosen_ = active_points();
    // Below 2 in 1 000 changed verdicts the tracks count as consistent.
    const std::int64_t settled = active_observations() / 500;
    bool falling = true;
    for (int round = 0; round < kMaxRounds; ++round) {
      const double sigma = robust_sigma(problem_, state_, options_);
      const double threshold = std::max(widest, kWide * sigma);
      const std::int64_t changed = screen_observations(problem_, state_, threshold, options_, chosen_);
      if (!falling && changed <= settled) break;
      solve_rough(Stage::kFocal, dense ? kFew : kMany);
      // The rounds go on while they still pay: residuals beyond two sigmas that a round shortens by three tenths or
      // more.
      const double next = robust_sigma(problem_, state_, options_);
      falling = next >= 2 && next <= 0.7 * sigma;
      if (!dense && !falling) break;  // the later rounds use the same tracks
    }
    // The tracks that did not take part come back with all their observations and are intersected at the new poses.
    std::vector<std::uint8_t> others(chosen_.size());
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) {
      others[p] = !chosen_[p];
      if (others[p])
        std::copy(all.begin() + problem_.begin[p], all.begin() + problem_.begin[p + 1],
                  problem_.kept.begin() + problem_.begin[p]);
    }
    if (!dense) chosen_.assign(chosen_.size(), 1);
    triangulate_points(problem_, state_, options_, others);
  }

  // Recovers what is still lost: parts of the tile as a whole, then single frames. It takes a few rounds, because they
  // may depend on one another.
  void recover() {
    constexpr int kMaxRounds = 3;
    const double limit = 8 * options_.max_residual_sigmas, apart = kApart * limit;
    screen(limit);
    for (int round = 0; round < kMaxRounds; ++round) {
      if (!take_up(recover_lost_parts(problem_, state_, apart), apart)) break;
      screen(limit);
    }
    for (int round = 0; round < kMaxRounds; ++round) {
      if (!take_up(recover_lost_frames(problem_, state_, limit), limit)) break;
      if (round + 1 < kMaxRounds) screen(limit);
    }
  }

  // Adjusts recovered frames with the observations that they keep now. Returns false when there are none.
  bool take_up(const std::vector<LocalFrame>& found, double limit) {
    if (found.empty()) return false;
    screen(limit);
    choose_points_of(found);
    solve_rough(Stage::kFocal);
    return true;
  }

  // Every point that a recovered frame observes takes part from now on. The chosen tracks were the longest of the
  // frames as they stood, and may hardly touch the recovered ones.
  void choose_points_of(const std::vector<LocalFrame>& frames) {
    std::vector<std::uint8_t> wanted(problem_.frames.size(), 0);
    for (const LocalFrame frame : frames) wanted[frame.value] = 1;
    for (std::int64_t p = 0; p < problem_.point_count(); ++p)
      for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1] && !chosen_[p]; ++row)
        chosen_[p] = problem_.image[row].valid() && wanted[problem_.images[problem_.image[row].value].frame.value];
  }

  // Whether the rough solutions are good enough: hardly any residual is beyond the final threshold.
  bool fits() const {
    constexpr double kHardlyAny = 0.01;
    const std::vector<double> lengths = residual_lengths(problem_, state_);
    const double limit = options_.max_residual_sigmas * threshold_factor(problem_, robust_sigma(lengths, options_));
    const auto beyond = std::count_if(lengths.begin(), lengths.end(), [&](double length) { return length > limit; });
    return static_cast<double>(beyond) <= kHardlyAny * static_cast<double>(lengths.size());
  }

  // Estimates the sigma of the observations. Returns whether the weights have changed enough to matter.
  bool adopt_image_sigma() {
    // A start needs only rough weights, and another solution of the whole tile for two per cent of the sigma would cost
    // more than it gives.
    const double settled = options_.only_start ? 0.05 : 0.02;
    const double before = problem_.image_sigma_px;
    if (options_.estimate_image_sigma) estimate_image_sigma(problem_, state_, options_);
    return std::abs(problem_.image_sigma_px / before - 1) > settled;
  }

  std::vector<std::uint8_t> active_points() const {
    std::vector<std::uint8_t> result(problem_.points.size());
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) result[p] = problem_.active(p);
    return result;
  }

  std::int64_t active_observations() const {
    return std::count(problem_.kept.begin(), problem_.kept.end(), std::uint8_t{1});
  }

  std::int64_t screen(double threshold) {
    const std::vector<std::uint8_t> before = problem_.kept;
    const std::int64_t changed =
        screen_observations(problem_, state_, threshold * threshold_factor(problem_, state_, options_), options_);
    for (std::size_t row = 0; row < before.size(); ++row) restored_ += !before[row] && problem_.kept[row];
    return changed;
  }

  // Runs a few iterations with the chosen points. The loss ignores gross errors and is as wide as the residuals. The
  // loss of the attitudes must not ignore large residuals, because attitudes may be the only observations that show how
  // the whole tile is turned.
  static constexpr int kMany = 10;
  void solve_rough(Stage stage, int iterations = kMany) {
    constexpr double kNear = 0.5, kFlat = 1e-3;  // sigmas of the frames, share of the cost
    const std::vector<std::uint8_t> all = problem_.kept;
    for (std::int64_t p = 0; p < problem_.point_count(); ++p)
      if (!chosen_[p])
        std::fill(problem_.kept.begin() + problem_.begin[p], problem_.kept.begin() + problem_.begin[p + 1], 0);
    const RobustLoss loss = problem_.image_loss, attitude_loss = problem_.attitude_loss;
    const RobustLoss position_loss = problem_.position_loss, control_loss = problem_.control_loss;
    // Cauchy's scale of s sigmas makes the loss as wide as the residuals are. A narrower one has several minima while
    // the tile is metres away from its optimum (docs/developer/decisions.md, "Tiles on their own").
    problem_.image_loss = {RobustLoss::Kind::kCauchy, std::max(2.0, robust_sigma(problem_, state_, options_))};
    problem_.attitude_loss = attitude_loss.from_afar();
    problem_.position_loss = position_loss.from_afar();
    problem_.control_loss = control_loss.from_afar();
    // The tolerance of the head, with k = 0.5 and the observations that take part here.
    const double near = 0.5 * kNear * kNear * frame_unknowns() / static_cast<double>(active_observations());
    solve({std::min(iterations, options_.max_iterations), std::max(kFlat, near), camera_free(stage)});
    problem_.image_loss = loss;
    problem_.attitude_loss = attitude_loss;
    problem_.position_loss = position_loss;
    problem_.control_loss = control_loss;
    problem_.kept = all;
  }

  // Iterates until a further iteration would lower the cost by a small fraction of a sigma only. Where the tile is only
  // a start, it iterates until a step would move the frames by less than a tenth of their sigmas.
  AdjustSummary solve_fine() {
    constexpr double kResolved = 0.01, kNear = 0.1;
    // The tolerance of the head, with k = 0.1 for a start. Otherwise a further iteration must lower the cost by less
    // than kResolved in all.
    const double cost = static_cast<double>(std::max<std::int64_t>(1, problem_.observation_count()));
    const double tolerance = options_.only_start ? std::max(kResolved, 0.5 * kNear * kNear * frame_unknowns()) / cost
                                                 : std::min(1e-6, kResolved / cost);
    return solve({options_.max_iterations, tolerance, camera_free(Stage::kAll)});
  }

  double frame_unknowns() const { return 6 * static_cast<double>(problem_.frames.size()); }

  AdjustSummary solve(const SolveOptions& solve_options) {
    const AdjustSummary summary = solver_(problem_, state_, solve_options);
    if (!summary.usable) throw ComputeError("the tile's adjustment does not converge: " + summary.text);
    return summary;
  }

  // The parameters that are estimated here: those of the stage that have a prior or enough images.
  std::vector<ParameterMask> camera_free(Stage stage) const {
    std::vector<ParameterMask> result = problem_.camera_free;
    for (std::size_t c = 0; c < result.size(); ++c) {
      for (int k = 0; k < state_.cameras[c].size(); ++k) {
        const ParameterRank rank = parameter_rank(state_.cameras[c].model(), k);
        // High powers of the radius, and a principal point that is confused with a rotation, take up the bend of a tile
        // that few images determine. They need more images than the focal length.
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
  std::vector<std::int64_t> images_;  // number of images of each camera
  std::vector<std::uint8_t> chosen_;  // [points] that take part in rough solutions
  std::int64_t restored_ = 0;
};

}  // namespace

double screening_threshold(const TileProblem& problem, const TileState& state, const AdjustOptions& options) {
  return options.max_residual_sigmas * threshold_factor(problem, state, options);
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
