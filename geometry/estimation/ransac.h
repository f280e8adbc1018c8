// Estimates a model from observations with many outliers, by random sample consensus (RANSAC) with local optimisation
// (Kalantari 2009, chapters 7 and 8 and annex A).
//
// It draws minimal samples, computes a model from each, and keeps the model with most support, until it is unlikely
// that no sample was free of outliers. With a share w of inliers, a sample of n is free of outliers with probability
// w^n, so that
//
//     k = log(1 - p) / log(1 - w^n)
//
// draws contain such a sample with probability p (M. Fischler and R. Bolles, CACM 24(6), 1981). w is taken from the
// best model so far; k falls as better models are found. The score of a model is its truncated quadratic support
// (MSAC),
//
//     sum over |r_i| <= t of 1 - (r_i / t)^2              (P. Torr and A. Zisserman, CVIU 78, 2000),
//
// Scoring of a model stops as soon as it cannot exceed the best score any more, or when a hundred of the observations
// show that it is unlikely to. Every new best model is refined with its inliers before the draws go on (O. Chum, J.
// Matas and J. Kittler, "Locally optimized RANSAC", DAGM 2003): the model of a minimal sample misses inliers, so it
// would underestimate w and draw too often.
//
// Without a given threshold, the threshold is chosen a contrario (L. Moisan and B. Stival, IJCV 57(3), 2004). It is the
// one, from a series in steps of sqrt(2), at which the agreement of so many observations is least likely to be an
// accident. Let a(t) be the probability that an outlier lies within t. Then the number of models as good as this one
// that N outliers would give (number of false alarms) is
//
//     NFA(k, t) = (N - n) C(N, k) C(k, n) a(t)^(k - n),
//
// and the score is -log10 of its minimum over t.
//
// An estimator provides a type Model, a constant kSampleSize, and the functions
//     size()                        number of observations
//     solve(rows)                   models of a sample: a list (optional results are lists of one, see solutions.h)
//     squared_residuals(model)      a function of the row; infinite or not a number where it cannot be an inlier
//     refine(model, threshold)      optional model, better for the observations within the threshold
//     chance(residual)              a(t), where thresholds are to be chosen a contrario
//     apart(row, row)               whether they are far enough apart for a sample, where that matters
//
// A draw allocates no memory. The result depends only on the estimator and the seed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <random>
#include <span>
#include <vector>

namespace megablock {

struct RansacOptions {
  double threshold = 0;      // largest residual of an inlier, in the units of the estimator; 0: chosen a contrario
  double max_threshold = 0;  // largest threshold tried a contrario; required if threshold = 0
  double confidence = 0.99;  // p, probability that one of the samples was free of outliers
  double inlier_share = 0;   // w is at least this, known beforehand; 0: not known
  int max_draws = 5000;
  int min_draws = 0;     // lower limit, for data where one sample free of outliers may not be enough
  double enumerate = 0;  // if there are no more samples than this, all are taken, without chance
  std::size_t keep = 1;  // number of models in the result, the best ones
  std::uint64_t seed = 0;
  void check() const;  // throws std::invalid_argument
};

// Number of draws after which, with probability `confidence`, one sample of `sample_size` observations was free of
// outliers. At least one; infinite for a share of zero.
double draws_needed(std::size_t sample_size, double inlier_share, double confidence);

// Number of samples of `sample_size` different observations, in any order.
double number_of_samples(std::size_t observations, std::size_t sample_size);

// Threshold that the residual of an inlier stays below with this probability, if each of its `components` is normally
// distributed with standard deviation `sigma` (chi-square distribution of the squared length).
double threshold_of_sigma(double sigma, int components, double probability = 0.99);

// The number of false alarms. A table of log10 of factorials makes each evaluation cheap.
class FalseAlarms {
 public:
  FalseAlarms(std::size_t observations, std::size_t sample_size);
  // log10 NFA of `agreeing` observations when an outlier agrees with probability `chance`. Infinite where no more
  // observations agree than a sample has.
  double log10_nfa(std::size_t agreeing, double chance) const;

 private:
  double log10_choose(std::size_t n, std::size_t k) const;
  std::size_t sample_size_;
  std::vector<double> log10_factorial_;
};

// The functions that every estimator must have. chance() and apart() are optional.
template <typename Estimator>
concept SampleEstimator = requires(const Estimator& e, const typename Estimator::Model& model,
                                   const std::array<std::size_t, Estimator::kSampleSize>& rows) {
  { e.size() } -> std::convertible_to<std::size_t>;
  { *e.solve(rows).begin() } -> std::convertible_to<typename Estimator::Model>;
  { e.squared_residuals(model)(std::size_t{}) } -> std::convertible_to<double>;
  { e.refine(model, 1.0) } -> std::convertible_to<std::optional<typename Estimator::Model>>;
};

// The observations that agree with a model.
struct Consensus {
  std::vector<std::uint8_t> inlier;  // one for each observation
  int count = 0;
  double score = 0;  // truncated quadratic support
};
// The consensus of a model at a threshold.
template <typename Estimator>
Consensus consensus_of(const Estimator& estimator, const typename Estimator::Model& model, double threshold) {
  Consensus result{std::vector<std::uint8_t>(estimator.size(), 0)};
  const auto squared_residual = estimator.squared_residuals(model);
  const double limit = threshold * threshold;
  for (std::size_t i = 0; i < estimator.size(); ++i) {
    const double r2 = squared_residual(i);
    if (!(r2 <= limit)) continue;
    result.inlier[i] = 1;
    ++result.count;
    result.score += 1 - r2 / limit;
  }
  return result;
}

template <typename Model>
struct RansacResult {
  Model model;
  Consensus consensus;
  double threshold = 0;  // the given threshold, or the chosen one
  double log10_nfa = 0;  // of the model, where the threshold was chosen
  int draws = 0;
  std::vector<Model> others{};  // the next best models in order, at most options.keep - 1
};

namespace ransac_detail {

// Advances to the next sample in lexicographic order, each in ascending order; false after the last.
template <std::size_t N>
bool next_sample(std::array<std::size_t, N>& rows, std::size_t size) {
  for (std::size_t k = N; k-- > 0;) {
    if (rows[k] == size - N + k) continue;
    ++rows[k];
    for (std::size_t j = k + 1; j < N; ++j) rows[j] = rows[j - 1] + 1;
    return true;
  }
  return false;
}

// Draws a sample of different observations. Where the estimator has apart(), they are far enough apart from one
// another.
template <typename Estimator>
std::array<std::size_t, Estimator::kSampleSize> draw(const Estimator& estimator, std::mt19937_64& random) {
  constexpr int kTries = 20;  // tries per observation; if all are crowded, a near one must do
  std::array<std::size_t, Estimator::kSampleSize> rows;
  int tries = 0;
  for (std::size_t k = 0; k < rows.size();) {
    rows[k] = random() % estimator.size();
    bool same = false, near = false;
    for (std::size_t j = 0; j < k; ++j) {
      same |= rows[j] == rows[k];
      if constexpr (requires { estimator.apart(rows[j], rows[k]); }) near |= !estimator.apart(rows[j], rows[k]);
    }
    if (same || (near && ++tries < kTries)) continue;
    tries = 0;
    ++k;
  }
  return rows;
}

// Score of a model with the threshold and inliers that belong to it.
struct Score {
  double value = 0, threshold = 0;
  std::size_t inliers = 0;
};

// Checks a hundred evenly spaced observations. Returns true if so few of them agree that a model as good as the best so
// far would show so few at most once in five thousand times (3.5 standard deviations of the binomial distribution).
template <typename Residual>
bool hopeless(const Residual& squared_residual, std::size_t size, double limit, const Score& best) {
  constexpr std::size_t kLooked = 100;
  if (size < 3 * kLooked) return false;
  const std::size_t step = size / kLooked;
  std::size_t agreeing = 0;
  for (std::size_t k = 0; k < kLooked; ++k) agreeing += squared_residual(k * step) <= limit;
  const double share = static_cast<double>(best.inliers) / static_cast<double>(size), expected = kLooked * share;
  return static_cast<double>(agreeing) < expected - 3.5 * std::sqrt(expected * (1 - share));
}

// Scores a model by its support within a given threshold. Returns an empty score where it does not exceed the best.
template <typename Residual>
Score supported(const Residual& squared_residual, std::size_t size, double threshold, const Score& best) {
  // The score is size - lost, so a model is hopeless once it has lost size - best.
  const double limit = threshold * threshold, most_lost = static_cast<double>(size) - best.value;
  if (hopeless(squared_residual, size, limit, best)) return {};
  double lost = 0;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const double r2 = squared_residual(i);
    if (r2 <= limit) {
      lost += r2 / limit;
      ++inliers;
    } else if ((lost += 1) >= most_lost) {
      return {};
    }
  }
  return {static_cast<double>(size) - lost, threshold, inliers};
}

// Scores a model by -log10 NFA at the best of kSteps thresholds, which fall from the largest by factors of sqrt(2).
template <typename Residual, typename Chance>
Score meaningful(const Residual& squared_residual, std::size_t size, std::size_t sample_size, double max_threshold,
                 const FalseAlarms& alarms, const Chance& chance) {
  constexpr std::size_t kSteps = 24;
  std::array<std::size_t, kSteps> within{};  // [i]: number of observations between thresholds i + 1 and i
  const double scale = 1 / (max_threshold * max_threshold);
  for (std::size_t i = 0; i < size; ++i) {
    const double share = squared_residual(i) * scale;
    if (!(share < 1)) continue;
    const int step = share > 0 ? -std::ilogb(share) - 1 : static_cast<int>(kSteps);
    ++within[std::min(static_cast<std::size_t>(step), kSteps - 1)];
  }
  Score best;
  std::size_t inliers = 0;
  for (std::size_t step = kSteps; step-- > 0;) {
    inliers += within[step];
    if (inliers <= sample_size) continue;
    const double threshold = max_threshold * std::pow(0.5, 0.5 * static_cast<double>(step));
    const double value = -alarms.log10_nfa(inliers, chance(threshold));
    if (value > best.value) best = {value, threshold, inliers};
  }
  return best;
}

}  // namespace ransac_detail

// Returns the best model, refined. Models in `starts` are scored before the first draw, for example models of a simpler
// kind. Empty for fewer observations than a sample needs, where no sample gives a model with more support than none,
// and (a contrario) where the agreement may be an accident. Throws std::invalid_argument for impossible options.
template <SampleEstimator Estimator>
std::optional<RansacResult<typename Estimator::Model>> ransac(const Estimator& estimator, const RansacOptions& options,
                                                              std::span<const typename Estimator::Model> starts = {}) {
  using Found = typename Estimator::Model;
  using Rows = std::array<std::size_t, Estimator::kSampleSize>;
  using ransac_detail::Score;
  constexpr std::size_t kSize = Estimator::kSampleSize;
  constexpr int kRounds = 4;  // of local optimisation, for each new best model
  options.check();
  const std::size_t size = estimator.size();
  if (size < kSize) return std::nullopt;

  std::optional<FalseAlarms> alarms;
  if (options.threshold == 0) alarms.emplace(size, kSize);
  struct Scored {
    Score score;
    Found model;
  };
  std::vector<Scored> best;  // sorted, best first
  best.reserve(options.keep + 1);
  // Scores a model and keeps it if it is among the best. Returns true if it is now the best one.
  const auto consider = [&](const Found& model) {
    const Score to_beat = best.size() < options.keep ? Score{} : best.back().score;
    Score score;
    if (!alarms) {
      score = ransac_detail::supported(estimator.squared_residuals(model), size, options.threshold, to_beat);
    } else if constexpr (requires { estimator.chance(1.0); }) {
      score = ransac_detail::meaningful(estimator.squared_residuals(model), size, kSize, options.max_threshold, *alarms,
                                        [&](double threshold) { return estimator.chance(threshold); });
    }
    if (!(score.value > to_beat.value)) return false;
    if (best.size() == options.keep) best.pop_back();
    const auto place =
        std::find_if(best.begin(), best.end(), [&](const Scored& other) { return score.value > other.score.value; });
    return best.insert(place, {score, model}) == best.begin();
  };
  double needed = options.max_draws;
  const auto draws_suffice = [&](double share) {
    needed = std::min(needed, std::max<double>(options.min_draws, draws_needed(kSize, share, options.confidence)));
  };
  if (options.inlier_share > 0) draws_suffice(options.inlier_share);
  const auto improve = [&] {
    for (int round = 0; round < kRounds && best.front().score.inliers > kSize; ++round) {
      const std::optional<Found> refined = estimator.refine(best.front().model, best.front().score.threshold);
      if (!refined || !consider(*refined)) break;
      if (best.size() > 1) best.erase(best.begin() + 1);  // the refined model replaces the one it came from
    }
    draws_suffice(static_cast<double>(best.front().score.inliers) / static_cast<double>(size));
  };

  bool better = false;
  for (const Found& start : starts) better |= consider(start);
  if (better) improve();
  const auto attempt = [&](const Rows& rows) {
    better = false;
    for (const Found& model : estimator.solve(rows)) better |= consider(model);
    if (better) improve();
  };
  int draws = 0;
  if (number_of_samples(size, kSize) <= options.enumerate) {
    Rows rows;
    std::iota(rows.begin(), rows.end(), std::size_t{0});
    do {
      attempt(rows);
      ++draws;
    } while (ransac_detail::next_sample(rows, size));
  } else {
    std::mt19937_64 random(options.seed);
    for (; draws < needed; ++draws) attempt(ransac_detail::draw(estimator, random));
  }
  if (best.empty()) return std::nullopt;
  const Score& score = best.front().score;
  RansacResult<Found> result{best.front().model, consensus_of(estimator, best.front().model, score.threshold),
                             score.threshold};
  result.log10_nfa = alarms ? -score.value : 0;
  result.draws = draws;
  for (std::size_t k = 1; k < best.size(); ++k) result.others.push_back(best[k].model);
  return result;
}

}  // namespace megablock
