#include "adjust/model_link.h"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <random>

#include "geometry/chi_square.h"
#include "geometry/median.h"
#include "geometry/minimal_similarity.h"
#include "geometry/rotation.h"
#include "io/error.h"

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

class LinkFit {
 public:
  LinkFit(const Model& a, const Model& b, const SharedRows& shared, const LinkOptions& options)
      : options_(options), limit_(chi_square_quantile(options.rejection_probability, 3)) {
    for (const auto& [i, j] : shared.points) {
      const ModelPoint &p = a.points[static_cast<std::size_t>(i)], &q = b.points[static_cast<std::size_t>(j)];
      places_.push_back({p.position, q.position, p.sigma, q.sigma});
    }
    for (const auto& [i, j] : shared.images) {
      const ModelImage &p = a.images[static_cast<std::size_t>(i)], &q = b.images[static_cast<std::size_t>(j)];
      places_.push_back({p.pose.centre, q.pose.centre, p.centre_sigma, q.centre_sigma});
      turns_.push_back({p.pose.rotation.conjugate() * q.pose.rotation, std::hypot(p.rotation_sigma, q.rotation_sigma)});
    }
    first_image_ = shared.points.size();
    std::seed_seq seed{static_cast<std::uint64_t>(a.number), static_cast<std::uint64_t>(b.number)};
    random_.seed(seed);
  }

  std::optional<ModelLink> run() {
    if (equations(std::vector<std::uint8_t>(places_.size(), 1)) < 7 + options_.min_redundancy) return std::nullopt;
    const auto start = best_sample();
    if (!start) return std::nullopt;
    Similarity s = *start;
    take_factors(s, equations(std::vector<std::uint8_t>(places_.size(), 1)));
    std::vector<std::uint8_t> agrees = agreeing(s, kWide * kWide * limit_);
    ModelLink link;
    for (int round = 0; round < kRounds; ++round) {
      if (!solve(agrees, s, link.information)) return std::nullopt;
      // A sample's misfits are larger than those of least squares.
      if (round < kRounds / 2) take_factors(s, equations(agrees));
      // Narrower with every round.
      const double factor = std::max(1.0, kWide / std::pow(2, round));
      const std::vector<std::uint8_t> next = agreeing(s, factor * factor * limit_);
      if (factor == 1 && next == agrees) break;
      agrees = next;
    }
    link.shared = static_cast<int>(places_.size());
    link.agreeing = static_cast<int>(std::count(agrees.begin(), agrees.end(), 1));
    if (equations(agrees) < 7 + options_.min_redundancy || link.agreeing < options_.min_share * link.shared)
      return std::nullopt;
    link.similarity = s;
    return link;
  }

 private:
  struct Place {
    Eigen::Vector3d a, b;
    double sigma_a, sigma_b;
  };
  struct Turn {
    Eigen::Quaterniond rotation;  // b -> a
    double sigma;
  };
  static constexpr double kWide = 4;  // a sample's error grows away from its points
  static constexpr int kRounds = 12;

  int equations(const std::vector<std::uint8_t>& agrees) const {
    int count = 0;
    for (std::size_t i = 0; i < agrees.size(); ++i)
      if (agrees[i]) count += i < first_image_ ? 3 : 6;
    return count;
  }

  // By how much the variances of places and of attitudes are larger than their sigmas say, each by its own median. Of
  // `used` equations seven go into the similarity.
  void take_factors(const Similarity& s, int used) {
    if (!options_.scale_sigmas) return;
    std::vector<double> places, turns;
    for (const Place& place : places_) places.push_back(place_factor_ * place_squares(s, place));
    for (const Turn& turn : turns_) turns.push_back(turn_factor_ * turn_squares(s, turn));
    const double typical = chi_square_quantile(0.5, 3) * (used - 7) / used;
    place_factor_ = std::max(1.0, middle_of(places) / typical);
    turn_factor_ = std::max(1.0, middle_of(turns) / typical);
  }
  // Unlike median() the mean of both middle ones: few images are in both models.
  static double middle_of(std::vector<double> values) {
    const double upper = median(values);
    for (double& value : values) value = -value;
    return 0.5 * (upper - median(std::move(values)));
  }

  double place_variance(const Similarity& s, const Place& place) const {
    return place_factor_ * (place.sigma_b * place.sigma_b + place.sigma_a * place.sigma_a / (s.scale * s.scale));
  }
  double place_squares(const Similarity& s, const Place& place) const {
    return (s.rotation.conjugate() * (place.a - s.translation) / s.scale - place.b).squaredNorm() /
           place_variance(s, place);
  }
  double turn_variance(const Turn& turn) const { return turn_factor_ * turn.sigma * turn.sigma; }
  double turn_squares(const Similarity& s, const Turn& turn) const {
    return std::pow(rotation_angle(s.rotation, turn.rotation), 2) / turn_variance(turn);
  }
  // The larger of place and attitude of an image.
  double squares(const Similarity& s, std::size_t i) const {
    const double place = place_squares(s, places_[i]);
    return i < first_image_ ? place : std::max(place, turn_squares(s, turns_[i - first_image_]));
  }
  std::vector<double> all_squares(const Similarity& s) const {
    std::vector<double> result(places_.size());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = squares(s, i);
    return result;
  }
  std::vector<std::uint8_t> agreeing(const Similarity& s, double limit) const {
    std::vector<std::uint8_t> result(places_.size());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = squares(s, i) <= limit;
    return result;
  }

  std::optional<Similarity> sample() {
    const std::size_t count = places_.size();
    const auto draw = [&] { return random_() % count; };
    if (!turns_.empty() && random_() % 2 == 0) {
      const std::size_t t = random_() % turns_.size(), i = first_image_ + t, j = draw();
      const Eigen::Vector3d in_a = places_[j].a - places_[i].a, in_b = places_[j].b - places_[i].b;
      if (!(in_b.norm() > 0) || !(in_a.norm() > 0)) return std::nullopt;
      Similarity s{in_a.norm() / in_b.norm(), turns_[t].rotation, {}};
      s.translation = places_[i].a - s.scale * (s.rotation * places_[i].b);
      return s;
    }
    const std::size_t i = draw(), j = draw(), k = draw();
    if (i == j || j == k || i == k) return std::nullopt;
    return solve_similarity({places_[i].b, places_[j].b, places_[k].b}, {places_[i].a, places_[j].a, places_[k].a});
  }

  std::optional<Similarity> best_sample() {
    constexpr double kMiss = 1e-6;  // probability that no sample is free of wrong points
    const double limit = kWide * kWide * limit_;
    std::optional<Similarity> best;
    double least = std::numeric_limits<double>::infinity();
    double wanted = options_.max_samples;
    for (int draw = 0; draw < options_.max_samples && draw < wanted; ++draw) {
      const auto candidate = sample();
      if (!candidate || !candidate->translation.allFinite()) continue;
      double value = 0;
      int agree = 0;
      if (options_.scale_sigmas) {
        value = median(all_squares(*candidate));
        agree = static_cast<int>(places_.size() / 2);
      }
      for (std::size_t i = 0; i < places_.size() && !options_.scale_sigmas && value < least; ++i) {
        const double e = squares(*candidate, i);
        value += std::min(e, limit);
        agree += e < limit;
      }
      if (!(value < least)) continue;
      best = candidate;
      least = value;
      const double good = std::pow(static_cast<double>(agree) / static_cast<double>(places_.size()), 3);
      wanted = good < 1 ? std::max(20.0, std::log(kMiss) / std::log1p(-good)) : 20;
    }
    return best;
  }

  // Least squares over what agrees.
  bool solve(const std::vector<std::uint8_t>& agrees, Similarity& s, SimilarityCovariance& information) const {
    for (int iteration = 0; iteration < 10; ++iteration) {
      information.setZero();
      SimilarityStep right = SimilarityStep::Zero();
      for (std::size_t i = 0; i < places_.size(); ++i) {
        if (!agrees[i]) continue;
        const Place& place = places_[i];
        const Eigen::Vector3d z = s.rotation.conjugate() * (place.a - s.translation) / s.scale;
        const double weight = 1 / place_variance(s, place);
        const Eigen::Matrix<double, 3, 7> by_step = by_model_step(z);
        information += weight * by_step.transpose() * by_step;
        right -= weight * by_step.transpose() * (z - place.b);
        if (i < first_image_) continue;
        const Turn& turn = turns_[i - first_image_];
        information.topLeftCorner<3, 3>().diagonal().array() += 1 / turn_variance(turn);
        right.head<3>() += rotation_log<double>(s.rotation.conjugate() * turn.rotation) / turn_variance(turn);
      }
      // Unit diagonal, so that what the points leave open shows.
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
      constexpr double kSettled = 1e-6;  // sigmas
      if (step.dot(information * step) < kSettled * kSettled) break;
    }
    return s.translation.allFinite() && s.scale > 0;
  }

  const LinkOptions& options_;
  double limit_;                               // of the squares of three equations
  double place_factor_ = 1, turn_factor_ = 1;  // of the variances
  std::vector<Place> places_;                  // points, then the centres of images
  std::vector<Turn> turns_;                    // of these
  std::size_t first_image_ = 0;
  std::mt19937_64 random_;
};

}  // namespace

std::optional<ModelLink> fit_model_link(const std::vector<Model>& models, std::int32_t a, std::int32_t b,
                                        const SharedRows& shared, const LinkOptions& options) {
  auto link = LinkFit(models[static_cast<std::size_t>(a)], models[static_cast<std::size_t>(b)], shared, options).run();
  if (link) link->a = a, link->b = b;
  return link;
}

}  // namespace megablock
