// The estimate is a fixed point: s = g(s), where g(s) is the weighted sum of squares over the redundancy of those
// residuals that a screening with the sigma s would keep, with the robust weights at s. The residuals are computed
// once; an iteration only sums them again.
#include "adjust/tile/image_sigma.h"

#include <algorithm>
#include <cmath>

#include "adjust/terms/linearise.h"

namespace megablock {

namespace {

constexpr double kFinestPx = 0.02;               // tie points are never observed more precisely
constexpr std::int64_t kFewestRedundancy = 100;  // the estimate is then good to 7 %

// Unknowns other than points, whether or not priors hold them: see the head of the header.
std::int64_t unknowns_of(const TileProblem& problem) {
  std::int64_t count = 6 * std::ssize(problem.frames);
  for (const ParameterMask mask : problem.camera_free) count += count_of(mask);
  for (const std::uint8_t free : problem.mount_free) count += free ? 6 : 0;
  return count;
}

// The squared residuals of the kept tie point observations.
struct SquaredResiduals {
  std::vector<double> values;  // px^2
  std::int64_t points = 0;
};

// Residuals of control points are left out: their sigmas are stated one by one.
SquaredResiduals squared_residuals(const TileProblem& problem, const TileState& state) {
  const std::vector<ImageView> views = image_views(problem, state);
  SquaredResiduals result;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (problem.points[p].role != PointRole::kTie || !problem.active(p)) continue;
    ++result.points;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
      if (problem.kept[row])
        result.values.push_back(views[problem.image[row].value]
                                    .difference_px(state.points[p], {problem.x[row], problem.y[row]})
                                    .squaredNorm());
  }
  return result;
}

ImageResiduals summed(const SquaredResiduals& squares, const RobustLoss& loss, double sigma_px,
                      const AdjustOptions& options) {
  const double weight = 1 / (sigma_px * sigma_px);
  const double largest = options.max_residual_sigmas * options.max_residual_sigmas;
  ImageResiduals result;
  result.points = squares.points;
  for (const double squared : squares.values) {
    // A residual that is not finite fails the test as well.
    if (!(weight * squared <= largest)) continue;
    // rho' is the robust weight at this sigma; the sum is in px^2.
    result.weighted_squares += loss.evaluate(weight * squared)[1] * squared;
    ++result.observations;
  }
  return result;
}

}  // namespace

void ImageResiduals::add(const ImageResiduals& other) {
  weighted_squares += other.weighted_squares;
  observations += other.observations;
  points += other.points;
}

ImageResiduals image_residuals(const TileProblem& problem, const TileState& state, const AdjustOptions& options) {
  return summed(squared_residuals(problem, state), problem.image_loss, problem.image_sigma_px, options);
}

std::optional<double> image_sigma(const ImageResiduals& residuals, std::int64_t unknowns) {
  const std::int64_t redundancy = 2 * residuals.observations - 3 * residuals.points - unknowns;
  if (redundancy < kFewestRedundancy) return std::nullopt;
  return std::max(kFinestPx, std::sqrt(residuals.weighted_squares / static_cast<double>(redundancy)));
}

void set_image_sigma(TileProblem& problem, double sigma_px) {
  problem.image_sigma_px = sigma_px;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (problem.points[p].role == PointRole::kTie)
      std::fill(problem.inverse_sigma.begin() + problem.begin[p], problem.inverse_sigma.begin() + problem.begin[p + 1],
                1 / sigma_px);
}

void estimate_image_sigma(TileProblem& problem, const TileState& state, const AdjustOptions& options) {
  constexpr int kMaxRounds = 20;
  constexpr double kSettled = 1e-3;
  const SquaredResiduals squares = squared_residuals(problem, state);
  double sigma_px = problem.image_sigma_px;
  for (int round = 0; round < kMaxRounds; ++round) {
    const auto sigma = image_sigma(summed(squares, problem.image_loss, sigma_px, options), unknowns_of(problem));
    if (!sigma) break;
    const double change = std::abs(*sigma / sigma_px - 1);
    sigma_px = *sigma;
    if (change < kSettled) break;
  }
  if (sigma_px != problem.image_sigma_px) set_image_sigma(problem, sigma_px);
}

}  // namespace megablock
