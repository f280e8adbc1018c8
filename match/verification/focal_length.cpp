#include "match/verification/focal_length.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>
#include <vector>

#include "geometry/estimation/ransac.h"
#include "geometry/numbers/decompositions.h"
#include "geometry/numbers/median.h"
#include "geometry/two_view/fundamental.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/pair_estimators.h"
#include "geometry/two_view/relative_adjustment.h"

namespace megablock {

namespace {

constexpr double kGridStep = 0.05;       // of the grid, in log f
constexpr std::size_t kMostPairs = 200;  // matches of a pair that are used, evenly spaced
constexpr double kFewestSigmaPx = 0.2;   // residuals of matches are never smaller
// Variances at which a pair contradicts a focal length with its whole vote: those of four sigmas, and a share of all,
// as matches of two images have errors in common.
constexpr double kVote = 16, kShared = 0.15;
constexpr double kPlane = 0.4;     // share of the matches that makes a plane
constexpr double kDissent = 0.05;  // share of the pairs that bounds the interval

struct Sensor {
  double larger_side, half_diagonal;  // pixels
};

Sensor sensor_of(int width, int height) {
  return {static_cast<double>(std::max(width, height)), 0.5 * std::hypot(width, height)};
}

// Steps of q, and its range in steps: from pincushion to barrel distortion.
constexpr double kDistortionStep = 0.05;
constexpr int kFewestSteps = -3, kMostSteps = 10;
constexpr double kLikely = 2;  // sigmas of a loss of support

PointPairs scaled(const PointPairs& points, double factor) {
  PointPairs result = points;
  for (auto* side : {&result.a, &result.b})
    for (Eigen::Vector2d& p : *side) p *= factor;
  return result;
}

// Corrects the distortion by q, and divides by the larger side.
PointPairs corrected(const PointPairs& pixels, double q, const Sensor& sensor) {
  PointPairs result = pixels;
  for (auto* side : {&result.a, &result.b})
    for (Eigen::Vector2d& p : *side)
      p *= (1 + q * p.squaredNorm() / (sensor.half_diagonal * sensor.half_diagonal)) / sensor.larger_side;
  return result;
}

std::optional<RansacResult<Eigen::Matrix3d>> find_fundamental(const PointPairs& points, double larger_side,
                                                              std::uint64_t seed, const FocalLengthOptions& options) {
  if (points.size() < static_cast<std::size_t>(options.min_inliers)) return std::nullopt;
  RansacOptions sampling;
  sampling.threshold = options.max_residual_px / larger_side;
  sampling.confidence = 0.999;
  sampling.max_draws = 3000;
  sampling.seed = seed;
  auto found = ransac(FundamentalEstimator(points), sampling);
  if (found && found->consensus.count < options.min_inliers) found.reset();
  return found;
}

// The inliers of a fundamental matrix, at most kMostPairs of them, with the sigma of their residuals; all in larger
// sides of the image.
struct Inliers {
  PointPairs points;
  Eigen::Matrix3d fundamental;
  double sigma = 0;
  std::optional<Eigen::Matrix3d> homography;  // of the plane with most of them, if there are enough
};

// Where a plane holds most matches, F is one of many, and tells no orientation.
std::optional<Eigen::Matrix3d> find_plane(const Inliers& inliers, std::uint64_t seed) {
  RansacOptions sampling;
  sampling.threshold = 3 * inliers.sigma;
  sampling.max_draws = 500;
  sampling.seed = seed;
  const auto found = ransac(HomographyEstimator(inliers.points), sampling);
  const auto enough = static_cast<int>(kPlane * static_cast<double>(inliers.points.size()));
  if (!found || found->consensus.count < enough) return std::nullopt;
  return found->model;
}

std::optional<Inliers> inliers_of_fundamental(const PointPairs& points, double larger_side, std::uint64_t seed,
                                              const FocalLengthOptions& options) {
  const auto found = find_fundamental(points, larger_side, seed, options);
  if (!found) return std::nullopt;
  Inliers inliers{{}, found->model, 0, {}};
  const auto count = static_cast<std::size_t>(found->consensus.count);
  const std::size_t used = std::min(count, kMostPairs);
  std::vector<double> squares;
  for (std::size_t i = 0, inlier = 0; i < points.size(); ++i) {
    if (!found->consensus.inlier[i]) continue;
    squares.push_back(squared_sampson(found->model, points.a[i], points.b[i]));
    // Number k of `count` is taken where k used / count passes an integer.
    if (inlier * used / count != (inlier + 1) * used / count) {
      inliers.points.a.push_back(points.a[i]);
      inliers.points.b.push_back(points.b[i]);
    }
    ++inlier;
  }
  inliers.sigma = std::max(1.4826 * std::sqrt(median(std::move(squares))), kFewestSigmaPx / larger_side);
  inliers.homography = find_plane(inliers, seed);
  return inliers;
}

// c(f) of the head of the header.
class PairCost {
 public:
  explicit PairCost(const Inliers& inliers) : inliers_(inliers), scale_(3 * inliers.sigma) {}

  struct Point {
    double cost = std::numeric_limits<double>::infinity();
    RelativeOrientation orientation;
  };

  // With the essential matrix nearest to F as a start. Its four orientations have the same residuals.
  Point from_fundamental(double focal) const {
    const Eigen::Vector3d k(focal, focal, 1);
    const auto starts =
        orientations_of_essential(nearest_essential(k.asDiagonal() * inliers_.fundamental * k.asDiagonal()));
    return starts.empty() ? Point{} : from(focal, *starts.begin());
  }

  // With the two orientations by the plane as starts.
  Point from_plane(double focal) const {
    Point best;
    if (!inliers_.homography) return best;
    const Eigen::Vector3d k(focal, focal, 1);
    Eigen::Matrix3d homography = k.cwiseInverse().asDiagonal() * *inliers_.homography * k.asDiagonal();
    homography /= singular_values3(homography).values[1];
    for (const PlanarOrientation& planar : orientations_of_homography(homography)) {
      // Each plane comes with both signs of its normal and base, which have the same residuals.
      if (!(planar.base_to_distance > 0) || planar.normal.z() < 0) continue;
      const Point point = from(focal, planar.orientation);
      if (point.cost < best.cost) best = point;
    }
    return best;
  }

  Point from(double focal, const RelativeOrientation& start) const {
    const PointPairs points = scaled(inliers_.points, 1 / focal);
    RelativeAdjustment by;
    by.scale = scale_ / focal;
    by.tolerance = 1e-6;
    const RelativeOrientation adjusted = adjust_orientation(start, points, by);
    return {cost_of(adjusted, points, by.scale), adjusted};
  }

 private:
  static double cost_of(const RelativeOrientation& orientation, const PointPairs& points, double scale) {
    const Eigen::Matrix3d essential = essential_from(orientation);
    double cost = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double u2 = squared_sampson(essential, points.a[i], points.b[i]) / (scale * scale);
      cost += std::isfinite(u2) ? u2 / (1 + u2) : 1;
    }
    return cost;
  }

  const Inliers& inliers_;
  double scale_;
};

// c at the points of the grid: the best of four starts, which are F, the plane, and both neighbours.
std::vector<double> costs_on_grid(const Inliers& inliers, const std::vector<double>& focals) {
  const PairCost cost(inliers);
  std::vector<PairCost::Point> points;
  for (const double focal : focals) {
    const PairCost::Point by_fundamental = cost.from_fundamental(focal), by_plane = cost.from_plane(focal);
    points.push_back(by_plane.cost < by_fundamental.cost ? by_plane : by_fundamental);
  }
  const auto improve = [&](std::size_t k, std::size_t neighbour) {
    if (!std::isfinite(points[neighbour].cost)) return;
    PairCost::Point other = cost.from(focals[k], points[neighbour].orientation);
    if (other.cost < points[k].cost) points[k] = other;
  };
  for (std::size_t k = 1; k < points.size(); ++k) improve(k, k - 1);
  for (std::size_t k = points.size() - 1; k-- > 0;) improve(k, k + 1);
  std::vector<double> costs;
  for (const PairCost::Point& point : points) costs.push_back(point.cost);
  return costs;
}

// Place of the vertex of the parabola through three points of the grid, in steps from the middle one.
double vertex(double before, double middle, double after) {
  const double curvature = before - 2 * middle + after;
  return curvature > 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0;
}

// v at the points of the grid.
std::vector<double> votes_of(const Inliers& inliers, const std::vector<double>& focals) {
  std::vector<double> votes = costs_on_grid(inliers, focals);
  const double lowest = *std::min_element(votes.begin(), votes.end());
  // u is 1 / 9, as the costs are in squares of three sigmas. It is more where no essential matrix fits as well as F.
  const double redundancy = std::max(1.0, static_cast<double>(inliers.points.size()) - 6);
  const double variance = std::max(1.0 / 9, lowest / redundancy);
  const double whole = (kVote + kShared * static_cast<double>(inliers.points.size())) * variance;
  for (double& vote : votes) vote = std::min(1.0, (vote - lowest) / whole);
  return votes;
}

// Fills in the focal length and its interval from the votes.
void find_least_contradicted(FocalLength& found) {
  const std::vector<double>& votes = found.votes;
  const auto lowest = std::min_element(votes.begin(), votes.end());
  const auto last = std::ssize(votes) - 1, k = lowest - votes.begin();
  const auto at = [&](std::ptrdiff_t i) { return votes[static_cast<std::size_t>(i)]; };
  const auto focal_at = [&](double place) { return found.grid_px.front() * std::exp(kGridStep * place); };
  const double level = *lowest + std::max(1.0, kDissent * found.asked);
  std::ptrdiff_t first = k, end = k;
  while (first > 0 && at(first - 1) <= level) --first;
  while (end < last && at(end + 1) <= level) ++end;
  found.open = first == 0 || end == last;
  // The ends lie between a point of the grid below the level and the next one above it.
  const double from = first == 0 ? 0 : (level - at(first)) / (at(first - 1) - at(first)),
               to = end == last ? 0 : (level - at(end)) / (at(end + 1) - at(end));
  found.from_px = focal_at(static_cast<double>(first) - from);
  found.to_px = focal_at(static_cast<double>(end) + to);
  found.focal_px = focal_at(static_cast<double>(k) + (k > 0 && k < last ? vertex(at(k - 1), at(k), at(k + 1)) : 0));
}

// The support of the fundamental matrix of each pair after a correction by q; 0: there is none.
std::vector<double> supports_with(double q, const std::vector<MatchedImages>& pairs, const Sensor& sensor,
                                  const FocalLengthOptions& options) {
  std::vector<double> supports(pairs.size());
#pragma omp parallel for schedule(dynamic, 1) num_threads(options.threads)
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const PointPairs points = corrected(pairs[i].pixels, q, sensor);
    const auto found = find_fundamental(points, sensor.larger_side, pairs[i].seed, options);
    supports[i] = found ? found->consensus.score : 0;
  }
  return supports;
}

double sum_of(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

// The first max_pairs pairs that have a fundamental matrix, with the sum of their supports without a correction.
std::pair<std::vector<MatchedImages>, double> usable_pairs(std::size_t count, const MatchedBatch& pairs,
                                                           const Sensor& sensor, const FocalLengthOptions& options) {
  const auto most = static_cast<std::size_t>(options.max_pairs);
  std::vector<MatchedImages> usable;
  double sum = 0;
  for (std::size_t first = 0; first < count && usable.size() < most; first += most) {
    std::vector<MatchedImages> next = pairs(first, std::min(first + most, count));
    const std::vector<double> supports = supports_with(0, next, sensor, options);
    for (std::size_t i = 0; i < next.size() && usable.size() < most; ++i) {
      if (!(supports[i] > 0)) continue;
      usable.push_back(std::move(next[i]));
      sum += supports[i];
    }
  }
  return {std::move(usable), sum};
}

// q with the largest support. It climbs from zero, with this support, in equal steps; the support has one peak.
double find_distortion(const std::vector<MatchedImages>& pairs, double uncorrected, const Sensor& sensor,
                       const FocalLengthOptions& options) {
  std::map<int, double> known{{0, uncorrected}};  // by number of steps
  const auto support = [&](int steps) {
    const auto [place, is_new] = known.try_emplace(steps);
    if (is_new) place->second = sum_of(supports_with(kDistortionStep * steps, pairs, sensor, options));
    return place->second;
  };
  int top = 0;
  for (const int direction : {1, -1})
    while (top + direction >= kFewestSteps && top + direction <= kMostSteps && support(top + direction) > support(top))
      top += direction;
  const double shift = vertex(-support(top - 1), -support(top), -support(top + 1));
  return kDistortionStep * (top + shift);
}

}  // namespace

void FocalLengthOptions::check() const {
  if (!(max_residual_px > 0)) throw std::invalid_argument("max_residual_px must be positive");
  if (!(min_ratio > 0 && max_ratio > min_ratio)) throw std::invalid_argument("0 < min_ratio < max_ratio is needed");
  if (min_inliers < 8 || min_pairs < 1 || max_pairs < min_pairs || threads < 1)
    throw std::invalid_argument("min_inliers >= 8, 1 <= min_pairs <= max_pairs and threads >= 1 are needed");
}

std::optional<FocalLength> focal_length_of(std::size_t count, const MatchedBatch& pairs, int width, int height,
                                           const FocalLengthOptions& options) {
  options.check();
  const Sensor sensor = sensor_of(width, height);
  const auto [usable, uncorrected] = usable_pairs(count, pairs, sensor, options);
  if (std::ssize(usable) < options.min_pairs) return std::nullopt;
  const double q = options.distortion ? *options.distortion : find_distortion(usable, uncorrected, sensor, options);
  FocalLength found;
  found.distortion = q;
  found.asked = static_cast<int>(usable.size());
  std::vector<double> focals;  // in larger sides
  for (double focal = options.min_ratio; focal <= options.max_ratio; focal *= std::exp(kGridStep))
    focals.push_back(focal);
  std::vector<std::vector<double>> of_pairs(usable.size());
#pragma omp parallel for schedule(dynamic, 1) num_threads(options.threads)
  for (std::size_t i = 0; i < usable.size(); ++i)
    if (const auto inliers =
            inliers_of_fundamental(corrected(usable[i].pixels, q, sensor), sensor.larger_side, usable[i].seed, options))
      of_pairs[i] = votes_of(*inliers, focals);
  found.votes.assign(focals.size(), 0);
  for (const double focal : focals) found.grid_px.push_back(focal * sensor.larger_side);
  for (const std::vector<double>& votes : of_pairs)
    for (std::size_t k = 0; k < votes.size(); ++k) found.votes[k] += votes[k];
  find_least_contradicted(found);
  return found;
}

std::vector<double> likely_distortions(std::size_t count, const MatchedBatch& pairs, int width, int height,
                                       const FocalLengthOptions& options, const FocalLength& found) {
  options.check();
  const Sensor sensor = sensor_of(width, height);
  const std::vector<MatchedImages> usable = usable_pairs(count, pairs, sensor, options).first;
  const std::vector<double> best = supports_with(found.distortion, usable, sensor, options);
  const auto likely = [&](double q) {
    const std::vector<double> other = supports_with(q, usable, sensor, options);
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < best.size(); ++i) sum += best[i] - other[i], squares += std::pow(best[i] - other[i], 2);
    return sum <= kLikely * std::sqrt(squares);
  };
  std::vector<double> all;
  for (const int direction : {1, -1})
    for (int step = direction;; step += direction) {
      const double q = found.distortion + kDistortionStep * step;
      if (q < kDistortionStep * kFewestSteps || q > kDistortionStep * kMostSteps || !likely(q)) break;
      all.push_back(q);
    }
  std::ranges::stable_sort(all, {}, [&](double q) { return std::abs(q - found.distortion); });
  return all;
}

// The grid hides what is finer than itself.
double FocalLength::sigma() const { return std::max(0.25 * kGridStep, 0.25 * std::log(to_px / from_px)); }

double FocalLength::against(double focal) const {
  const double place =
      std::clamp(std::log(focal / grid_px.front()) / kGridStep, 0.0, static_cast<double>(votes.size() - 1));
  const auto below = static_cast<std::size_t>(place), above = std::min(below + 1, votes.size() - 1);
  const double share = place - static_cast<double>(below);
  return std::lerp(votes[below], votes[above], share) - *std::min_element(votes.begin(), votes.end());
}

}  // namespace megablock
