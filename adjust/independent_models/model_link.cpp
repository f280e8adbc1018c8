// Tests a link. The squared residual of a place, or of an attitude, is chi-square with three degrees of freedom; the
// limit is the value that it exceeds with `rejection_probability`. The first limit is kSampleReach^2 times as large and
// falls by a factor of four in each round: the similarity of three places is inexact away from them.
//
// With `scale_sigmas` the variances are known up to a factor for places and one for attitudes. Both follow from
// medians. Of m equations, 7 are used up by the similarity, so that the median of a squared residual is expected to be
// chi^2_0.5(3) (m - 7) / m.
#include "adjust/independent_models/model_link.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/estimation/ransac.h"
#include "geometry/numbers/chi_square.h"
#include "geometry/numbers/median.h"
#include "geometry/similarity/similarity_estimator.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"

namespace megablock {

void LinkOptions::check() const {
  if (!(rejection_probability > 0 && rejection_probability < 0.1))
    throw InputError("assembly: rejection_probability must lie between 0 and 0.1");
  if (min_redundancy < 1) throw InputError("assembly: min_redundancy must be at least 1");
  if (!(min_share >= 0 && min_share <= 1)) throw InputError("assembly: min_share must lie between 0 and 1");
  if (max_samples < 1) throw InputError("assembly: max_samples must be at least 1");
}

Similarity move_in_model(const Similarity& similarity, const SimilarityStep& xi) {
  Similarity moved = similarity;
  moved.translation += similarity.scale * (similarity.rotation * xi.tail<3>());
  moved.rotation = rotation_update(similarity.rotation, xi.head<3>());
  moved.scale *= std::exp(xi(3));
  return moved;
}

SimilarityStep step_of(const Similarity& near_identity) {
  SimilarityStep xi;
  xi << rotation_log<double>(near_identity.rotation), std::log(near_identity.scale), near_identity.translation;
  return xi;
}

Eigen::Matrix<double, 3, 7> by_model_step(const Eigen::Vector3d& z) {
  Eigen::Matrix<double, 3, 7> result;
  result << skew(z), -z, -Eigen::Matrix3d::Identity();
  return result;
}

namespace {

// A factor of the first limit. The error of a sample grows with the distance from its points.
constexpr double kSampleReach = 4;

// The places and attitudes that two models share, as an estimator for RANSAC. A sample is three places, or the attitude
// of an image with the distance of two places. The residual of an image is the larger one of those of place and
// attitude.
class LinkEstimator {
 public:
  using Model = Similarity;
  static constexpr std::size_t kSampleSize = 3;

  LinkEstimator(const megablock::Model& a, const megablock::Model& b, const SharedRows& shared)
      : places_(places_of(a, b, shared)), by_places_(places_), first_image_(shared.points.size()) {
    for (const auto& [i, j] : shared.images) {
      const ModelImage &p = a.images[static_cast<std::size_t>(i)], &q = b.images[static_cast<std::size_t>(j)];
      turns_.push_back({p.pose.rotation.conjugate() * q.pose.rotation, std::hypot(p.rotation_sigma, q.rotation_sigma)});
    }
  }
  LinkEstimator(const LinkEstimator&) = delete;  // by_places_ refers to places_
  LinkEstimator& operator=(const LinkEstimator&) = delete;

  std::size_t size() const { return places_.size(); }
  int equations() const { return equations(std::vector<std::uint8_t>(size(), 1)); }
  int equations(const std::vector<std::uint8_t>& agrees) const {
    int count = 0;
    for (std::size_t i = 0; i < agrees.size(); ++i)
      if (agrees[i]) count += turn(i) ? 6 : 3;
    return count;
  }
  // The probability by the places alone. This is on the safe side: an image whose attitude must fit too does so by
  // accident less often.
  double chance(double sigmas) const { return by_places_.chance(sigmas); }
  double extent() const { return by_places_.extent(); }

  Solutions<Similarity, 4> solve(const std::array<std::size_t, 3>& rows) const {
    Solutions<Similarity, 4> found;
    for (const Similarity& s : by_places_.solve(rows)) found.push_back(s);
    // An image that both models hold gives the rotation. Its centre and another place give the scale by their distance,
    // and the shift. Two places are then enough, which matters where models share few images.
    for (std::size_t k = 0; k < 3; ++k)
      if (const Turn* of_image = turn(rows[k])) {
        const SimilarityPair &here = places_[rows[k]], &there = places_[rows[(k + 1) % 3]];
        const double in_a = (there.to - here.to).norm(), in_b = (there.from - here.from).norm();
        if (!(in_a > 0) || !(in_b > 0)) continue;
        Similarity s{in_a / in_b, of_image->rotation, {}};
        s.translation = here.to - s.scale * (s.rotation * here.from);
        found.push_back(s);
      }
    return found;
  }
  auto squared_residuals(const Similarity& s) const {
    return [this, s, of_place = by_places_.squared_residuals(s)](std::size_t i) {
      const double place = of_place(i) / place_factor_;
      const Turn* of_image = turn(i);
      return of_image ? std::max(place, turn_squares(s, *of_image) / turn_factor_) : place;
    };
  }
  std::optional<Similarity> refine(Similarity s, double threshold) const {
    constexpr int kSteps = 2;
    SimilarityCovariance information;
    if (!adjust(agreeing(s, threshold * threshold), kSteps, s, information)) return std::nullopt;
    return s;
  }
  std::vector<std::uint8_t> agreeing(const Similarity& s, double limit) const {
    const auto squares = squared_residuals(s);
    std::vector<std::uint8_t> result(size());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = squares(i) <= limit;
    return result;
  }

  // Sets the factors by which the variances of positions and attitudes exceed the given ones, from the medians over the
  // inliers. Seven of their equations determine the similarity, so the expected median is smaller by that share.
  void take_factors(const Similarity& s, const std::vector<std::uint8_t>& agrees) {
    const auto of_place = by_places_.squared_residuals(s);
    std::vector<double> places, turns;
    for (std::size_t i = 0; i < size(); ++i) {
      if (!agrees[i]) continue;
      places.push_back(of_place(i));
      if (const Turn* of_image = turn(i)) turns.push_back(turn_squares(s, *of_image));
    }
    const double used = equations(agrees), typical = chi_square_quantile(0.5, 3) * (used - 7) / used;
    place_factor_ = std::max(1.0, middle_of(std::move(places)) / typical);
    turn_factor_ = std::max(1.0, middle_of(std::move(turns)) / typical);
  }

  // Least squares over the inliers.
  bool adjust(const std::vector<std::uint8_t>& agrees, int max_iterations, Similarity& s,
              SimilarityCovariance& information) const {
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      information.setZero();
      SimilarityStep right = SimilarityStep::Zero();
      for (std::size_t i = 0; i < size(); ++i) {
        if (!agrees[i]) continue;
        const SimilarityPair& place = places_[i];
        // z = S^-1 x_a. The weight holds the variance of both places in the units of b.
        const Eigen::Vector3d z = s.rotation.conjugate() * (place.to - s.translation) / s.scale;
        const double weight = 1 / (place_factor_ * (place.sigma_from * place.sigma_from +
                                                    place.sigma_to * place.sigma_to / (s.scale * s.scale)));
        const Eigen::Matrix<double, 3, 7> by_step = by_model_step(z);
        information += weight * by_step.transpose() * by_step;
        right -= weight * by_step.transpose() * (z - place.from);
        const Turn* of_image = turn(i);
        if (!of_image) continue;
        const double trust = 1 / (turn_factor_ * of_image->sigma * of_image->sigma);
        information.topLeftCorner<3, 3>().diagonal().array() += trust;
        right.head<3>() += trust * rotation_log<double>(s.rotation.conjugate() * of_image->rotation);
      }
      // The diagonal is scaled to one, so that small pivots show the components that the points do not determine.
      const SimilarityStep size = information.diagonal().cwiseSqrt();
      if (!(size.minCoeff() > 0) || !size.allFinite()) return false;
      const SimilarityCovariance scaled =
          size.cwiseInverse().asDiagonal() * information * size.cwiseInverse().asDiagonal();
      const Eigen::LDLT<SimilarityCovariance> factor(scaled);
      constexpr double kOpen = 1e-10;
      if (!(factor.vectorD().minCoeff() > kOpen)) return false;
      const SimilarityStep step =
          size.cwiseInverse().asDiagonal() * factor.solve(size.cwiseInverse().asDiagonal() * right);
      s = move_in_model(s, step);
      // The length of the step in the metric of its own normal equations, sqrt(xi' N xi), has the unit of one sigma.
      constexpr double kSettled = 1e-6;  // sigmas
      if (step.dot(information * step) < kSettled * kSettled) break;
    }
    return s.translation.allFinite() && s.scale > 0;
  }

 private:
  struct Turn {
    Eigen::Quaterniond rotation;  // b -> a
    double sigma;
  };
  // The places of points, then those of the centres of images, from b to a.
  static std::vector<SimilarityPair> places_of(const megablock::Model& a, const megablock::Model& b,
                                               const SharedRows& shared) {
    std::vector<SimilarityPair> places;
    for (const auto& [i, j] : shared.points) {
      const ModelPoint &p = a.points[static_cast<std::size_t>(i)], &q = b.points[static_cast<std::size_t>(j)];
      places.push_back({q.position, p.position, q.sigma, p.sigma});
    }
    for (const auto& [i, j] : shared.images) {
      const ModelImage &p = a.images[static_cast<std::size_t>(i)], &q = b.images[static_cast<std::size_t>(j)];
      places.push_back({q.pose.centre, p.pose.centre, q.centre_sigma, p.centre_sigma});
    }
    return places;
  }
  const Turn* turn(std::size_t i) const { return i < first_image_ ? nullptr : &turns_[i - first_image_]; }
  static double turn_squares(const Similarity& s, const Turn& turn) {
    return std::pow(rotation_angle(s.rotation, turn.rotation) / turn.sigma, 2);
  }
  // Unlike median() it is the mean of both middle values, because few images are in both models.
  static double middle_of(std::vector<double> values) {
    const double upper = median(values);
    for (double& value : values) value = -value;
    return 0.5 * (upper - median(std::move(values)));
  }

  std::vector<SimilarityPair> places_;
  SimilarityEstimator by_places_;
  std::size_t first_image_;
  std::vector<Turn> turns_;                    // of the images
  double place_factor_ = 1, turn_factor_ = 1;  // of the variances
};

// The number of equations that a link needs.
int fewest(const LinkOptions& options) { return 7 + options.min_redundancy; }

// The best sample, with its inliers. With known sigmas the threshold is kSampleReach times the limit of a place. If the
// sigmas are known only up to a factor, the a-contrario method finds the threshold. Where it finds too few inliers, the
// threshold is the extent of the shared points.
std::optional<RansacResult<Similarity>> best_sample(const LinkEstimator& estimator, const LinkOptions& options,
                                                    double limit, std::uint64_t seed) {
  constexpr double kMiss = 1e-6;  // probability that every sample contains a wrong point
  RansacOptions sampling;
  sampling.max_draws = options.max_samples;
  sampling.confidence = 1 - kMiss;
  sampling.seed = seed;
  if (!options.scale_sigmas) {
    sampling.threshold = kSampleReach * std::sqrt(limit);
    return ransac(estimator, sampling);
  }
  const double extent = estimator.extent();
  if (!(extent > 0)) return std::nullopt;
  // A point more than a tenth of the shared extent away is no evidence.
  sampling.max_threshold = 0.1 * extent;
  const auto found = ransac(estimator, sampling);
  if (found && estimator.equations(found->consensus.inlier) >= fewest(options)) return found;
  // A few bad places fit no better than by accident; other links decide about them.
  sampling.threshold = extent;
  // The first sample fits nearly all places, so that one draw would be thought enough.
  sampling.min_draws = std::min(20, options.max_samples);
  return ransac(estimator, sampling);
}

// A robust start, then rounds of least squares over the inliers and a new test, until the inliers rest at the final
// limit. Empty where they become too few.
std::optional<ModelLink> fit_link(LinkEstimator& estimator, const LinkOptions& options, std::uint64_t seed) {
  constexpr int kRounds = 12;
  if (estimator.equations() < fewest(options)) return std::nullopt;
  const double limit = chi_square_quantile(options.rejection_probability, 3);  // of the squares of three equations
  const auto start = best_sample(estimator, options, limit, seed);
  if (!start) return std::nullopt;
  Similarity s = start->model;
  std::vector<std::uint8_t> agrees = start->consensus.inlier;
  if (options.scale_sigmas) {
    if (estimator.equations(agrees) < fewest(options)) return std::nullopt;
    estimator.take_factors(s, agrees);
    agrees = estimator.agreeing(s, kSampleReach * kSampleReach * limit);
  }
  ModelLink link;
  for (int round = 0; round < kRounds; ++round) {
    if (!estimator.adjust(agrees, 10, s, link.information)) return std::nullopt;
    // The factors are held in the second half. Factors and inliers that follow each other might not come to rest.
    if (options.scale_sigmas && round < kRounds / 2) estimator.take_factors(s, agrees);
    // The limit becomes narrower in every round.
    const double factor = std::max(1.0, kSampleReach / std::pow(2, round));
    const std::vector<std::uint8_t> next = estimator.agreeing(s, factor * factor * limit);
    if (estimator.equations(next) < fewest(options)) return std::nullopt;
    if (factor == 1 && next == agrees) break;
    agrees = next;
  }
  link.shared = static_cast<int>(estimator.size());
  link.agreeing = static_cast<int>(std::count(agrees.begin(), agrees.end(), 1));
  if (link.agreeing < options.min_share * link.shared) return std::nullopt;
  link.similarity = s;
  return link;
}

}  // namespace

std::optional<ModelLink> fit_model_link(const std::vector<Model>& models, std::int32_t a, std::int32_t b,
                                        const SharedRows& shared, const LinkOptions& options) {
  const Model &first = models[static_cast<std::size_t>(a)], &second = models[static_cast<std::size_t>(b)];
  const std::uint64_t seed =
      (static_cast<std::uint64_t>(first.number) << 32) ^ static_cast<std::uint64_t>(second.number);
  LinkEstimator estimator(first, second, shared);
  auto link = fit_link(estimator, options, seed);
  if (link) link->a = a, link->b = b;
  return link;
}

}  // namespace megablock
