// Random sample consensus with local optimisation: a model from observations of which many may be wrong (Kalantari
// 2009, M42, M49, M55).
//
// Samples of as few observations as give a model are drawn until it is unlikely that none was free of wrong ones. Of a
// share w of right observations a sample of n is right with probability w^n, so that
//
//     k = log(1 - p) / log(1 - w^n)
//
// draws hold a right one with probability p (M. Fischler and R. Bolles, CACM 24(6), 1981). w is that of the best model
// so far: k falls as better ones are found. A model is scored by its truncated quadratic support
//
//     sum over |r_i| <= t of 1 - (r_i / t)^2              (P. Torr and A. Zisserman, CVIU 78, 2000),
//
// and given up as soon as it cannot exceed the best one's any more, or is unlikely to by a hundred observations. Every
// new best model is refined over its inliers before the draws go on (O. Chum, J. Matas and J. Kittler, "Locally
// optimized RANSAC", DAGM 2003): the model of a minimal sample misses inliers, and w with them.
//
// Without a threshold it is chosen a contrario (L. Moisan and B. Stival, IJCV 57(3), 2004): of thresholds in steps of
// sqrt(2) the one at which so many observations agree the least by accident. With a(t) the probability that a wrong
// observation lies within t, the number of models as good as this one that N wrong observations would give is
//
//     NFA(k, t) = (N - n) C(N, k) C(k, n) a(t)^(k - n),
//
// and the score is -log10 of its minimum over t.
//
// An estimator has a Model, kSampleSize, and
//     size()                        number of observations
//     solve(rows)                   models of a sample: a list (optional results are lists of one, see solutions.h)
//     squared_residuals(model)      a function of the row; infinite or not a number where it cannot be an inlier
//     refine(model, threshold)      optional model, better for the observations within the threshold
//     chance(residual)              a(t), where thresholds are to be chosen a contrario
//     apart(row, row)               whether they are far enough apart for a sample, where that matters
//
// Nothing is allocated in a draw. The outcome depends on the estimator and the seed alone.
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
  double threshold = 0;      // of the residuals of inliers, in their units; 0: chosen a contrario
  double max_threshold = 0;  // largest one that is tried a contrario; must then be given
  double confidence = 0.99;  // p
  double inlier_share = 0;   // w is known to be at least this; 0: not known
  int max_draws = 5000;
  int min_draws = 0;     // where a single right sample may not be enough
  double enumerate = 0;  // all samples are taken, one after the other, where there are no more than these
  std::size_t keep = 1;  // models in the result: the best ones
  std::uint64_t seed = 0;
  void check() const;  // throws std::invalid_argument
};

// Draws after which one of `sample_size` right observations was among them with the probability `confidence`; at least
// one, infinite for a share of zero.
double draws_needed(std::size_t sample_size, double inlier_share, double confidence);

// Of distinct observations, in any order.
double number_of_samples(std::size_t observations, std::size_t sample_size);

// Threshold below which a right observation's residual lies with this probability, when each of its `components` has
// the standard deviation `sigma`.
double threshold_of_sigma(double sigma, int components, double probability = 0.99);

// Logarithms of factorials for the number of false alarms.
class FalseAlarms {
 public:
  FalseAlarms(std::size_t observations, std::size_t sample_size);
  // log10 NFA of k agreeing observations where a wrong one agrees with this probability.
  double log10_nfa(std::size_t agreeing, double chance) const;

 private:
  double log10_choose(std::size_t n, std::size_t k) const;
  std::size_t sample_size_;
  std::vector<double> log10_factorial_;
};

template <typename Estimator>
concept SampleEstimator = requires(const Estimator& e, const typename Estimator::Model& model,
                                   const std::array<std::size_t, Estimator::kSampleSize>& rows) {
  { e.size() } -> std::convertible_to<std::size_t>;
  { *e.solve(rows).begin() } -> std::convertible_to<typename Estimator::Model>;
  { e.squared_residuals(model)(std::size_t{}) } -> std::convertible_to<double>;
  { e.refine(model, 1.0) } -> std::convertible_to<std::optional<typename Estimator::Model>>;
};

// What agrees with a model.
struct Consensus {
  std::vector<std::uint8_t> inlier;  // [observations]
  int count = 0;
  double score = 0;  // truncated quadratic support
};
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
  double threshold = 0;  // the one given, or chosen
  double log10_nfa = 0;  // where it was chosen
  int draws = 0;
  std::vector<Model> others{};  // the next best in order, of those that were scored; options.keep - 1 at most
};

namespace ransac_detail {

// The next one of the ascending samples of `size` observations; false after the last.
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

// Distinct observations, apart from one another where the estimator knows what that is.
template <typename Estimator>
std::array<std::size_t, Estimator::kSampleSize> draw(const Estimator& estimator, std::mt19937_64& random) {
  constexpr int kTries = 20;  // an observation that is too near to others; where all crowd, any must do
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

struct Score {
  double value = 0, threshold = 0;
  std::size_t inliers = 0;
};

// Whether so few of some hundred observations agree that a model as good as the best has them once in five thousand
// times at most.
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

// By the support within a given threshold; empty where that of the best is not exceeded.
template <typename Residual>
Score supported(const Residual& squared_residual, std::size_t size, double threshold, const Score& best) {
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

// By the number of false alarms at the best of kSteps thresholds.
template <typename Residual, typename Chance>
Score meaningful(const Residual& squared_residual, std::size_t size, std::size_t sample_size, double max_threshold,
                 const FalseAlarms& alarms, const Chance& chance) {
  constexpr std::size_t kSteps = 24;
  std::array<std::size_t, kSteps> within{};  // [i]: observations between the thresholds i + 1 and i
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

// The best model, refined; empty for fewer observations than a sample needs, where no sample gives a model that more
// than none agree with, and where what agrees may do so by accident (a contrario). `starts`: models to begin with, such
// as those of a simpler kind.
template <SampleEstimator Estimator>
std::optional<RansacResult<typename Estimator::Model>> ransac(const Estimator& estimator, const RansacOptions& options,
                                                              std::span<const typename Estimator::Model> starts = {}) {
  using Found = typename Estimator::Model;
  using Rows = std::array<std::size_t, Estimator::kSampleSize>;
  using ransac_detail::Score;
  constexpr std::size_t kSize = Estimator::kSampleSize;
  constexpr int kRounds = 4;  // of local optimisation
  options.check();
  const std::size_t size = estimator.size();
  if (size < kSize) return std::nullopt;

  std::optional<FalseAlarms> alarms;
  if (options.threshold == 0) alarms.emplace(size, kSize);
  struct Scored {
    Score score;
    Found model;
  };
  std::vector<Scored> best;  // first
  best.reserve(options.keep + 1);
  // True where the model is the best one now.
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
      if (best.size() > 1) best.erase(best.begin() + 1);  // what it was refined from is no model of its own
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
