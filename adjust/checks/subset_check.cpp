// With x_ki the result of item i in subset k (K subsets), the spread is sum (x_ki - x_i)^2 / (K - 1) per component,
// where x_i is the mean of the subsets: the variance of one subset. The mean of the subsets has the variance spread^2 /
// K, to which the error common to all subsets is added.
#include "adjust/checks/subset_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "adjust/terms/linearise.h"
#include "io/base/error.h"

namespace megablock {

namespace {

// Keeps the reference, the control points, and every `count`-th of the tie points that take part, beginning with number
// `first`.
void keep_subset(TileProblem& problem, std::int64_t reference, int first, int count) {
  std::int64_t turn = 0;
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    const auto point = static_cast<std::size_t>(p);
    if (p == reference || problem.points[point].role != PointRole::kTie || !problem.active(p)) continue;
    if (turn++ % count != first)
      std::fill(problem.kept.begin() + problem.begin[point], problem.kept.begin() + problem.begin[point + 1], 0);
  }
}

std::vector<Eigen::Vector2d> reference_images(const TileProblem& problem, const TileState& state, std::int64_t point) {
  std::vector<Eigen::Vector2d> images;
  const auto p = static_cast<std::size_t>(point);
  for (auto row = static_cast<std::size_t>(problem.begin[p]); row < static_cast<std::size_t>(problem.begin[p + 1]);
       ++row)
    if (problem.kept[row])
      images.push_back(Eigen::Vector2d(problem.x[row], problem.y[row]) +
                       image_difference_px(problem, state, point, static_cast<std::int64_t>(row)));
  return images;
}

// The rms per component of [subsets][items] about their mean over the subsets, and the rms of these means.
template <typename Vector>
struct Dispersion {
  double spread = 0, mean = 0;
  explicit Dispersion(const std::vector<std::vector<Vector>>& values) {
    const std::size_t items = values.front().size();
    const auto subsets = static_cast<double>(values.size());
    for (std::size_t i = 0; i < items; ++i) {
      Vector middle = Vector::Zero();
      for (const auto& subset : values) middle += subset[i] / subsets;
      mean += middle.squaredNorm();
      for (const auto& subset : values) spread += (subset[i] - middle).squaredNorm() / (subsets - 1);
    }
    const double components = static_cast<double>(items) * static_cast<double>(Vector::SizeAtCompileTime);
    spread = std::sqrt(spread / components);
    mean = std::sqrt(mean / components);
  }
};

}  // namespace

double SubsetCheck::rotation_sigma_rad() const {
  return std::hypot(rotation_spread_rad / std::sqrt(static_cast<double>(subsets)), common_sigma_rad);
}

SubsetCheck check_point_subsets(const TileProblem& problem, const TileState& state, std::int64_t reference, int subsets,
                                const MotionReference& motion, const TileSolver& solver) {
  if (subsets < 2) throw InputError("a check by point subsets needs two subsets at least");
  if (reference < 0 || reference >= problem.point_count() || !problem.active(reference))
    throw InputError(fmt::format("point {}, the reference of a check by point subsets, takes no part", reference));
  std::vector<std::vector<Eigen::Vector3d>> turns;
  std::vector<std::vector<Eigen::Vector2d>> images;
  for (int subset = 0; subset < subsets; ++subset) {
    TileProblem part = problem;
    keep_subset(part, reference, subset, subsets);
    TileState adjusted = state;
    const AdjustSummary summary = solver(part, adjusted, {});
    if (!summary.usable) throw ComputeError(fmt::format("point subset {}: {}", subset, summary.text));
    turns.emplace_back();
    for (std::size_t f = 0; f < adjusted.frames.size(); ++f)
      // Rotation vectors from the start, in the axes of the ground. They are small, so that their mean is that of the
      // rotations.
      turns.back().push_back(rotation_log<double>(state.frames[f].rotation.conjugate() * adjusted.frames[f].rotation));
    // Where the adjusted reference point falls in its images: observation plus residual.
    images.push_back(reference_images(part, adjusted, reference));
  }
  const Dispersion<Eigen::Vector3d> turning(turns);
  SubsetCheck check;
  check.subsets = subsets;
  check.rotation_spread_rad = turning.spread;
  check.rotation_move_rad = turning.mean;
  check.image_spread_px = Dispersion<Eigen::Vector2d>(images).spread;
  // The error that all subsets share comes from the attitude priors, which all of them use.
  const MotionVerdict verdict = judge(common_motion(problem, state, motion), motion);
  check.common_sigma_rad = std::max(verdict.common_sigma_rad, verdict.line_sigma_rad);
  return check;
}

}  // namespace megablock
