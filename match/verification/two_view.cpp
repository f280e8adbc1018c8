#include "match/verification/two_view.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "geometry/estimation/ransac.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/median.h"
#include "geometry/transform/rotation_fit.h"
#include "geometry/two_view/homography.h"
#include "geometry/two_view/pair_estimators.h"

namespace megablock {

namespace {

// A simpler model is chosen if it explains this share of the matches of the general one.
constexpr double kRotationShare = 0.9, kPlaneShare = 0.8;
// The fundamental matrix is tried if the inliers are below the first share of all matches. It is chosen if it has more
// inliers by the second factor.
constexpr double kDoubtfulShare = 0.4, kFocalGain = 1.3;
// If fewer matches than this share support the orientation from known verticals, five points check it.
constexpr double kDoubtfulVertical = 0.25;
// Steps of an adjustment below kSettled (radians) change nothing that matters, as orientations are accurate to about
// 1e-4. Adjustments that only tell candidates apart, and are repeated later, need only kNear.
constexpr double kSettled = 1e-7, kNear = 1e-5;
// Share of right matches within the limit of transfer residuals that follows from the sigma of the matches.
constexpr double kRightShare = 0.999;
// Share of the best orientation's support that the other orientation of a plane needs to be its twin.
constexpr double kTwinShare = 0.95;

// Confidence of the RANSAC with five points that looks for more support than verticals gave.
constexpr double kSecondLook = 0.9;
// If it finds less than this factor more support, the orientation from verticals stands.
constexpr double kSameSupport = 1.05;

RelativeAdjustment adjustment(double scale, double tolerance = kSettled) {
  RelativeAdjustment by;
  by.scale = scale;
  by.tolerance = tolerance;
  return by;
}

std::vector<std::size_t> rows_of(const std::vector<std::uint8_t>& inlier) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < inlier.size(); ++i)
    if (inlier[i]) rows.push_back(i);
  return rows;
}

// The pairs that are inliers.
PointPairs selected_pairs(const PointPairs& points, const std::vector<std::uint8_t>& inlier) {
  PointPairs pairs;
  for (const std::size_t i : rows_of(inlier)) {
    pairs.a.push_back(points.a[i]);
    pairs.b.push_back(points.b[i]);
  }
  return pairs;
}

struct InlierRays {
  std::vector<Eigen::Vector3d> a, b;
};
InlierRays rays_of(const PointPairs& points, const std::vector<std::uint8_t>& inlier) {
  InlierRays rays;
  for (const std::size_t i : rows_of(inlier)) {
    rays.a.push_back(points.a[i].homogeneous().normalized());
    rays.b.push_back(points.b[i].homogeneous().normalized());
  }
  return rays;
}

struct Hypothesis {
  RelativeOrientation orientation;
  Consensus support;
  double scale = 0;               // of the weights of its adjustment
  std::vector<double> weights{};  // further weights; empty: equal
};

// The estimation of one pair: samples, comparison of models, refinement, and selection of the inliers.
class PairEstimation {
 public:
  PairEstimation(const PointPairs& points, const TwoViewOptions& options)
      : points_(points),
        options_(options),
        five_points_(points, options.max_residual, options.sample_spacing),
        transfer_limit_(options.max_residual),
        needed_(inliers_needed()) {}

  TwoView estimate() {
    TwoView none;
    none.inlier.assign(points_.size(), 0);
    // The general model comes first. Its inliers tell how many draws the simpler models need in order to replace it.
    if (const auto general = orientation()) refine_all(std::array{*general});
    transfer_limit_ = transfer_limit();
    const auto rotation = simpler<RotationPairEstimator>(300, kRotationShare);
    const auto plane = simpler<HomographyEstimator>(1000, kPlaneShare);
    const int rotation_count = rotation ? rotation->consensus.count : 0,
              plane_count = plane ? plane->consensus.count : 0;
    if (plane && plane_count >= kPlaneShare * best_count()) refine_all(twins(plane->consensus.inlier));
    const int best_count = this->best_count();

    if (rotation_count >= needed_ && rotation_count >= kRotationShare * best_count) return turned(*rotation);
    // A plane leaves the fundamental matrix undetermined, so it is not tried then.
    const bool planar = plane_count >= kPlaneShare * best_count;
    if (best_count < needed_ || (!planar && best_count < kDoubtfulShare * static_cast<double>(points_.size()))) {
      auto found = uncalibrated();
      if (found && found->inlier_count > kFocalGain * best_count) return *std::move(found);
    }
    if (best_count < needed_) return none;
    return oriented(planar);
  }

 private:
  RansacOptions sampling(double limit, int max_draws, double inlier_share = 0) const {
    RansacOptions sampling;
    sampling.threshold = limit;
    sampling.confidence = 0.999;
    sampling.max_draws = max_draws;
    sampling.inlier_share = inlier_share;
    sampling.seed = options_.seed;
    return sampling;
  }

  // Number of inliers that a model needs beyond chance. A random match falls into the band along its epipolar line with
  // probability (area of the band) / (area of the image), and the unknowns of the model adapt to some more of them.
  int inliers_needed() const {
    constexpr double kAdaptation = 4;
    Eigen::AlignedBox2d box;
    for (const auto& p : points_.b) box.extend(p);
    const Eigen::Vector2d size = box.sizes().cwiseMax(options_.max_residual);
    const double share = std::min(1.0, 2 * options_.max_residual * size.norm() / size.prod());
    const auto count = static_cast<double>(points_.size());
    const double by_chance = std::max(options_.by_chance, kAdaptation * share) * count;
    // Matches that crowd into a corner all lie in the band; at most half of the matches are taken as accidental.
    return options_.min_inliers + static_cast<int>(std::min(by_chance, 0.5 * count));
  }

  // The two orientations that explain a plane, from its homography.
  std::vector<RelativeOrientation> twins(const std::vector<std::uint8_t>& inlier) const {
    const InlierRays rays = rays_of(points_, inlier);
    std::vector<RelativeOrientation> found;
    if (const auto homography = fit_homography(rays.a, rays.b))
      for (const PlanarOrientation& planar : visible_orientations(*homography, rays.a))
        found.push_back(planar.orientation);
    return found;
  }

  // The orientation from samples of five points. If the verticals are known, samples of three points come first. If
  // their result agrees with the verticals, a few draws of five points only check whether there is more support: errors
  // of the verticals lead into side minima, above all with uncalibrated cameras.
  std::optional<RelativeOrientation> orientation() {
    std::vector<RelativeOrientation> starts;
    if (options_.vertical_a && options_.vertical_b) {
      const VerticalPairEstimator estimator(points_, options_.max_residual, options_.vertical_a->direction,
                                            options_.vertical_b->direction, options_.sample_spacing);
      if (const auto found = counted(ransac(estimator, sampling(options_.max_residual, 1000)))) {
        starts.push_back(adjust_orientation(found->model, points_, adjustment(0.5 * options_.max_residual, kNear)));
        by_vertical_ = found->consensus.count >= needed_ &&
                       found->consensus.count >= kDoubtfulVertical * static_cast<double>(points_.size()) &&
                       agrees_with_verticals(starts.front(), found->consensus);
      }
    }
    RansacOptions five = sampling(options_.max_residual, 3000);
    if (by_vertical_) five.confidence = kSecondLook;
    const auto found = counted(ransac(five_points_, five, std::span<const RelativeOrientation>(starts)));
    if (!found) return std::nullopt;
    if (by_vertical_) {
      const Consensus start = consensus_of(five_points_, starts.front(), options_.max_residual);
      by_vertical_ = found->consensus.score <= kSameSupport * start.score;
    }
    return found->model;
  }

  // Whether the rotation turns one vertical into the other, within four sigmas of both verticals and of the rotation,
  // plus a tenth of a degree for errors that the sigmas do not cover.
  bool agrees_with_verticals(const RelativeOrientation& found, const Consensus& support) const {
    constexpr double kSigmas = 4, kMore = 0.1 * kDegree;
    const Eigen::Matrix3d rotation = found.rotation.toRotationMatrix();
    const AxisDirection &a = *options_.vertical_a, &b = *options_.vertical_b;
    const OrientationPrecision precision =
        precision_of(found, points_, support.inlier, 0.5 * options_.max_residual, 1e-3 * options_.max_residual);
    const Eigen::Vector3d turned = rotation * a.direction;
    const Eigen::Matrix3d by_rotation = rotation * skew<double>(a.direction);
    Eigen::Matrix3d covariance = rotation * a.covariance * rotation.transpose() + b.covariance +
                                 by_rotation * precision.covariance.topLeftCorner<3, 3>() * by_rotation.transpose();
    covariance += kMore * kMore / (kSigmas * kSigmas) * Eigen::Matrix3d::Identity();
    // Makes the matrix regular; along the vertical there is no difference.
    covariance += b.direction * b.direction.transpose();
    const Eigen::Vector3d difference = turned - b.direction;
    return turned.dot(b.direction) > 0 && difference.dot(covariance.inverse() * difference) < kSigmas * kSigmas;
  }

  int best_count() const { return hypotheses_.empty() ? 0 : hypotheses_.front().support.count; }

  // A rotation, or a plane. The general model explains its matches too. Samples are therefore drawn from the inliers of
  // the general model, of which most must agree for the simpler model to be chosen. Without a general model they come
  // from all matches.
  template <typename Estimator>
  std::optional<RansacResult<typename Estimator::Model>> simpler(int max_draws, double share) {
    if (best_count() < needed_) return counted(ransac(Estimator(points_), sampling(transfer_limit_, max_draws)));
    return sampled_from<Estimator>(hypotheses_.front().support, sampling(transfer_limit_, max_draws, share));
  }

  // Draws samples from the consensus alone; refines and scores the model with all matches.
  template <typename Estimator>
  std::optional<RansacResult<typename Estimator::Model>> sampled_from(const Consensus& consensus,
                                                                      const RansacOptions& options) {
    const PointPairs agreeing = selected_pairs(points_, consensus.inlier);
    const auto found = counted(ransac(Estimator(agreeing), options));
    if (!found) return std::nullopt;
    return ransac(Estimator(points_), sampling(options.threshold, 1), std::span(&found->model, 1));
  }

  template <typename Result>
  Result counted(Result found) {
    if (found) draws_ += found->draws;
    return found;
  }

  // Refines candidates with all matches and sorts them by score. Keeps either the refined or the original orientation.
  void refine_all(std::span<const RelativeOrientation> candidates) {
    for (const RelativeOrientation& start : candidates) {
      const RelativeOrientation refined =
          adjust_orientation(start, points_, adjustment(0.5 * options_.max_residual, kNear));
      Hypothesis before{start, consensus_of(five_points_, start, options_.max_residual), 0.5 * options_.max_residual};
      Hypothesis after{refined, consensus_of(five_points_, refined, options_.max_residual),
                       0.5 * options_.max_residual};
      hypotheses_.push_back(std::move(after.support.score > before.support.score ? after : before));
    }
    std::stable_sort(hypotheses_.begin(), hypotheses_.end(),
                     [](const Hypothesis& p, const Hypothesis& q) { return p.support.score > q.support.score; });
  }

  // The final adjustment over the inliers. Their scatter determines the reach of the robust weights, and leverage
  // weights bound the influence of single matches.
  Hypothesis polished(const Hypothesis& start) const {
    const Eigen::Matrix3d essential = essential_from(start.orientation);
    std::vector<double> residuals;
    for (const std::size_t i : rows_of(start.support.inlier))
      residuals.push_back(std::abs(sampson_residual(essential, points_.a[i], points_.b[i])));
    const double sigma = 1.4826 * median(std::move(residuals)), limit = options_.max_residual;
    const double scale = std::clamp(2 * sigma, 1e-3 * limit, 0.5 * limit);
    const std::vector<double> weights = leverage_weights(start.orientation, points_, start.support.inlier);
    const RelativeOrientation last = adjust_orientation(start.orientation, points_, adjustment(scale), weights);
    Hypothesis result{last, consensus_of(five_points_, last, limit), scale, {}};
    result.weights = leverage_weights(last, points_, result.support.inlier);
    return result.support.score > 0.98 * start.support.score ? result : start;
  }

  // Standard deviation of a residual component, from the median of the squared residuals and the redundancy of a model
  // with this number of unknowns. With too few matches it is the largest allowed residual.
  template <typename Estimator>
  double sigma_of(const Estimator& estimator, const typename Estimator::Model& model, const Consensus& within,
                  int components, int unknowns) const {
    const auto squared_residual = estimator.squared_residuals(model);
    std::vector<double> squares;
    for (const std::size_t i : rows_of(within.inlier)) squares.push_back(squared_residual(i));
    const double equations = components * static_cast<double>(within.count);
    if (!(equations > unknowns)) return options_.max_residual;
    const double sigma = std::sqrt(median(std::move(squares)) / chi_square_quantile(0.5, components) * equations /
                                   (equations - unknowns));
    return std::max(sigma, 1e-3 * options_.max_residual);  // matches are never exact
  }

  // The limit of transfer residuals. They contain the errors of both points in two components. With the limit of
  // Sampson residuals, planes and rotations of inaccurate matches would not be recognised.
  double transfer_limit() const {
    const double limit = options_.max_residual;
    if (hypotheses_.empty() || std::isinf(options_.max_sigmas)) return limit;
    const Hypothesis& general = hypotheses_.front();
    const double sigma = sigma_of(five_points_, general.orientation, general.support, 1, 5),
                 largest = limit / threshold_of_sigma(1, 1, kRightShare);
    return std::max(limit, threshold_of_sigma(std::numbers::sqrt2 * std::min(sigma, largest), 2, kRightShare));
  }

  // Restricts a consensus within `limit` to the matches that its standard deviation allows.
  template <typename Estimator>
  Consensus selected(const Estimator& estimator, const typename Estimator::Model& model, const Consensus& within,
                     double limit, int components, int unknowns) const {
    const double narrow = options_.max_sigmas * sigma_of(estimator, model, within, components, unknowns);
    if (!(narrow < limit)) return within;
    Consensus result = consensus_of(estimator, model, narrow);
    return result.count < options_.min_inliers ? within : result;
  }

  // The final selection of inliers and a last adjustment over them. `wide` has the inliers within max_residual.
  Hypothesis selected(const Hypothesis& wide) const {
    Hypothesis last = wide;
    const auto select = [&](const Consensus& within) {
      last.support = selected(five_points_, last.orientation, within, options_.max_residual, 1, 5);
      last.weights = leverage_weights(last.orientation, points_, last.support.inlier);
    };
    select(wide.support);
    last.orientation = adjust_orientation(last.orientation, points_, adjustment(last.scale), last.weights);
    select(consensus_of(five_points_, last.orientation, options_.max_residual));
    return last;
  }

  TwoView finish(PairModel model, const Eigen::Quaterniond& rotation, Consensus support) const {
    TwoView result;
    result.model = model;
    result.rotation = rotation;
    result.inlier_count = support.count;
    result.inlier = std::move(support.inlier);
    result.draws = draws_;
    // The median intersection angle tells later stages how well the pair determines depths.
    std::vector<double> angles;
    for (const std::size_t i : rows_of(result.inlier))
      angles.push_back(intersection_angle(rotation, points_.a[i], points_.b[i]));
    result.median_angle_deg = median(std::move(angles)) / kDegree;
    return result;
  }

  void set_base(TwoView& result, const Hypothesis& of) const {
    result.translation = of.orientation.base;
    result.precision = precision_of_hypothesis(of, result.inlier);
    result.ill_conditioned = !(result.precision.base_sigma() <= options_.max_base_sigma_deg * kDegree);
  }

  OrientationPrecision precision_of_hypothesis(const Hypothesis& of, std::span<const std::uint8_t> inlier) const {
    return precision_of(of.orientation, points_, inlier, of.scale, 1e-3 * options_.max_residual, of.weights);
  }

  TwoView oriented(bool planar) {
    // Adjust over the inliers first, then narrow the inliers by the sigma of the adjusted residuals.
    const Hypothesis best = polished(hypotheses_.front());
    const Hypothesis last = selected(best);
    TwoView result =
        finish(planar ? PairModel::kHomography : PairModel::kEssential, last.orientation.rotation, last.support);
    set_base(result, last);
    result.by_vertical = by_vertical_;
    // For a plane, another orientation with nearly the same support and a clearly different base or rotation is the
    // twin.
    for (const Hypothesis& other : std::span(hypotheses_).subspan(1)) {
      if (!planar || other.support.score < kTwinShare * best.support.score) continue;
      const Hypothesis twin = polished(other);
      const double apart = std::max(rotation_angle(twin.orientation.rotation, best.orientation.rotation),
                                    (twin.orientation.base - best.orientation.base).norm());
      if (!(apart > 3 * kDegree)) continue;
      result.twin = twin.orientation;
      result.twin_precision = precision_of_hypothesis(twin, twin.support.inlier);
      break;
    }
    return result;
  }

  TwoView turned(const RansacResult<Eigen::Quaterniond>& found) const {
    const RotationPairEstimator estimator(points_);
    RansacResult<Eigen::Quaterniond> best = found;
    // Least squares over all inliers, repeated while the score grows.
    for (int round = 0; round < 10; ++round) {
      const InlierRays rays = rays_of(points_, best.consensus.inlier);
      const Eigen::Quaterniond rotation = fit_rotation(rays.a, rays.b);
      Consensus support = consensus_of(estimator, rotation, transfer_limit_);
      if (!(support.score > best.consensus.score)) break;
      best.model = rotation;
      best.consensus = std::move(support);
    }
    best.consensus = selected(estimator, best.model, best.consensus, transfer_limit_, 2, 3);
    TwoView result = finish(PairModel::kRotationOnly, best.model, best.consensus);
    const InlierRays rays = rays_of(points_, result.inlier);
    result.precision = precision_of_rotation(best.model, rays.a, rays.b, 1e-3 * options_.max_residual);
    result.ill_conditioned = true;  // the base is unknown
    return result;
  }

  // The case of wrong focal lengths: a fundamental matrix fits where no essential matrix does. Its orientation is
  // approximate. Right matches still lie near the epipolar lines of the best essential matrix, and most wrong ones do
  // not, so samples come from matches near them.
  std::optional<TwoView> uncalibrated() {
    const double limit = 4 * options_.max_residual;
    const FivePointEstimator estimator(points_, limit);
    const RansacOptions options = sampling(options_.max_residual, 3000);
    const auto found = best_count() < needed_
                           ? counted(ransac(FundamentalEstimator(points_), options))
                           : sampled_from<FundamentalEstimator>(
                                 consensus_of(estimator, hypotheses_.front().orientation, limit), options);
    if (!found || found->consensus.count < needed_) return std::nullopt;
    // The four orientations of the nearest essential matrix, each with and without adjustment; the best supported one
    // is taken.
    std::optional<Hypothesis> best;
    for (const RelativeOrientation& start : orientations_of_essential(nearest_essential(found->model))) {
      const RelativeOrientation refined = adjust_orientation(start, points_, adjustment(0.5 * limit));
      for (const RelativeOrientation& o : {start, refined}) {
        Consensus support = consensus_of(estimator, o, limit);
        if (!best || support.score > best->support.score) best = {o, std::move(support), 0.5 * limit};
      }
    }
    if (!best || best->support.count < needed_ / 2) return std::nullopt;
    TwoView result = finish(PairModel::kEssential, best->orientation.rotation, found->consensus);
    set_base(result, *best);
    return result;
  }

  const PointPairs& points_;
  const TwoViewOptions& options_;
  FivePointEstimator five_points_;
  double transfer_limit_;  // limit of the residuals of rotations and planes
  int needed_;
  int draws_ = 0;
  bool by_vertical_ = false;
  std::vector<Hypothesis> hypotheses_;
};

std::array<double, 4> stored(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }
std::array<double, 3> stored(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
std::array<double, 6> upper_triangle(const Eigen::Matrix3d& c) {
  return {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
}

void set_orientation(PairOrientation& pair, const Eigen::Quaterniond& rotation, const Eigen::Vector3d& base,
                     const OrientationPrecision& precision) {
  pair.rotation_wxyz = stored(rotation);
  pair.translation = stored(base);
  pair.rotation_covariance = upper_triangle(precision.covariance.topLeftCorner<3, 3>());
  pair.base_covariance = {};
  if (!(base.squaredNorm() > 0)) return;
  const auto across = axes_across(base);
  pair.base_covariance = upper_triangle(across * precision.covariance.bottomRightCorner<2, 2>() * across.transpose());
}

}  // namespace

void set_orientation(VerifiedPair& pair, const TwoView& found) {
  pair.model = found.model;
  set_orientation(pair, found.rotation, found.translation, found.precision);
  pair.median_angle_deg = found.median_angle_deg;
  pair.ill_conditioned = found.ill_conditioned;
  pair.twin.reset();
  if (found.twin) set_orientation(pair.twin.emplace(), found.twin->rotation, found.twin->base, found.twin_precision);
}

TwoView estimate_two_view(const PointPairs& points, const TwoViewOptions& options) {
  if (points.size() < static_cast<std::size_t>(options.min_inliers)) {
    TwoView none;
    none.inlier.assign(points.size(), 0);
    return none;
  }
  return PairEstimation(points, options).estimate();
}

}  // namespace megablock
