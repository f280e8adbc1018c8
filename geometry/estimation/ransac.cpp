#include "geometry/estimation/ransac.h"

#include <algorithm>
#include <stdexcept>

#include "geometry/numbers/chi_square.h"

namespace megablock {

void RansacOptions::check() const {
  if (!(threshold >= 0) || (threshold == 0 && !(max_threshold > 0)))
    throw std::invalid_argument("ransac: threshold must be positive, or 0 together with a positive max_threshold");
  if (!(confidence > 0 && confidence < 1))
    throw std::invalid_argument("ransac: confidence must be above 0 and below 1");
  if (!(inlier_share >= 0 && inlier_share <= 1)) throw std::invalid_argument("ransac: inlier_share must be in [0, 1]");
  if (max_draws < 1) throw std::invalid_argument("ransac: max_draws must be at least 1");
  if (min_draws > max_draws) throw std::invalid_argument("ransac: min_draws must not exceed max_draws");
  if (keep < 1) throw std::invalid_argument("ransac: keep must be at least 1");
}

double number_of_samples(std::size_t observations, std::size_t sample_size) {
  double number = observations >= sample_size ? 1 : 0;
  for (std::size_t k = 0; k < sample_size; ++k)
    number *= static_cast<double>(observations - k) / static_cast<double>(k + 1);
  return number;
}

double draws_needed(std::size_t sample_size, double inlier_share, double confidence) {
  const double right = std::pow(std::clamp(inlier_share, 0.0, 1.0), static_cast<double>(sample_size));
  if (!(right > 0)) return std::numeric_limits<double>::infinity();
  if (right >= 1) return 1;
  return std::max(1.0, std::ceil(std::log1p(-confidence) / std::log1p(-right)));
}

double threshold_of_sigma(double sigma, int components, double probability) {
  return sigma * std::sqrt(chi_square_quantile(1 - probability, components));
}

FalseAlarms::FalseAlarms(std::size_t observations, std::size_t sample_size)
    : sample_size_(sample_size), log10_factorial_(observations + 1, 0) {
  for (std::size_t i = 2; i <= observations; ++i)
    log10_factorial_[i] = log10_factorial_[i - 1] + std::log10(static_cast<double>(i));
}

double FalseAlarms::log10_choose(std::size_t n, std::size_t k) const {
  return log10_factorial_[n] - log10_factorial_[k] - log10_factorial_[n - k];
}

double FalseAlarms::log10_nfa(std::size_t agreeing, double chance) const {
  const std::size_t n = log10_factorial_.size() - 1;
  if (agreeing <= sample_size_ || agreeing > n) return std::numeric_limits<double>::infinity();
  return std::log10(static_cast<double>(n - sample_size_)) + log10_choose(n, agreeing) +
         log10_choose(agreeing, sample_size_) +
         static_cast<double>(agreeing - sample_size_) * std::log10(std::clamp(chance, 1e-300, 1.0));
}

}  // namespace megablock
