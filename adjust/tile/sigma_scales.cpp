#include "adjust/tile/sigma_scales.h"

#include <algorithm>
#include <cmath>

namespace megablock {

using enum ObservationKind;

bool SigmaScales::matter() const {
  constexpr double kSettled = 0.02;
  return std::any_of(of.begin(), of.end(), [](double scale) { return std::abs(scale - 1) > kSettled; });
}

SigmaScales next_sigma_scales(const SigmaScales& now, const ObservationTable& table) {
  constexpr double kFewestRedundancy = 30;
  constexpr double kMostAtOnce = 10;
  SigmaScales scales;
  for (const ObservationKind kind :
       {kPositionHorizontal, kPositionHeight, kAttitude, kRelativeRotation, kRelativePosition, kVertical}) {
    const ObservationStatistics& s = table[kind];
    if (s.redundancy < kFewestRedundancy) continue;
    const double shown = std::clamp(std::sqrt(s.weighted_squares / s.redundancy), 1 / kMostAtOnce, kMostAtOnce);
    scales[kind] = std::max(1.0, now[kind] * shown) / now[kind];
  }
  return scales;
}

void scale_sigmas(TileProblem& problem, const SigmaScales& scales) {
  const double horizontal = scales[kPositionHorizontal];
  for (auto& term : problem.positions)
    term.prior.sigma.array() *= Eigen::Array3d(horizontal, horizontal, scales[kPositionHeight]);
  for (auto& term : problem.attitudes) term.prior.sigma_rad *= scales[kAttitude];
  for (auto& term : problem.verticals) {
    term.weight /= scales[kVertical];
    term.by_camera /= scales[kVertical];
  }
  for (auto& term : problem.relatives) {
    term.rotation_sigma_rad *= scales[kRelativeRotation];
    term.position_sigma_m *= scales[kRelativePosition];
  }
}

}  // namespace megablock
