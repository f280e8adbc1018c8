// The factor of a kind of observation is the root of its variance component v'Pv / redundancy, with the exact
// redundancy sum (1 - J Q J') of the last adjustment. An adjustment with other sigmas has other redundancies, so the
// estimate is repeated over adjustments.
#include "adjust/tile/sigma_scales.h"

#include <algorithm>
#include <cmath>

namespace megablock {

SigmaScales next_sigma_scales(const SigmaScales& now, const ObservationTable& table) {
  constexpr double kFewestRedundancy = 30;
  constexpr double kMostAtOnce = 10;
  SigmaScales scales;
  for (std::size_t k = 0; k < kObservationKinds; ++k) {
    const auto kind = static_cast<ObservationKind>(k);
    if (!estimates_sigma(kind)) continue;
    const ObservationStatistics& s = table[kind];
    if (s.redundancy < kFewestRedundancy) continue;
    // A factor of more than ten at a time comes from outliers or from a start far away. The next adjustment may ask for
    // more.
    const double shown = std::clamp(std::sqrt(s.weighted_squares / s.redundancy), 1 / kMostAtOnce, kMostAtOnce);
    // The sum of all factors so far, now * shown, stays at one or above: sigmas are never below the stated ones.
    scales[kind] = std::max(1.0, now[kind] * shown) / now[kind];
  }
  return scales;
}

void scale_sigmas(TileProblem& problem, const SigmaScales& scales) {
  for (const ObservationType* type : observation_types()) type->scale_sigmas(problem, scales);
}

}  // namespace megablock
