#include "adjust/calibration/loose_sigmas.h"

#include <algorithm>
#include <cmath>

namespace megablock {

IntrinsicSigmas loose_sigmas(const Intrinsics& start, int width, int height) {
  constexpr double kLooser = 10;
  IntrinsicSigmas sigma = weak_sigmas(start, 0, width);
  for (double& s : sigma) s *= kLooser;
  // weak_sigmas() speaks of one focal length from the centre; long lenses end far inside of it.
  const double corner = std::min(1.0, 0.5 * std::hypot(width, height) / start[kFocal]);
  const ParameterMask radial = radial_terms(start.model(), kMaxIntrinsics);
  double power = start.model().kind == CameraModelKind::kEvenRadial ? corner : corner * corner;
  for (int p = 0; p < start.size(); ++p) {
    if (!contains(radial, p)) continue;
    sigma[static_cast<std::size_t>(p)] /= power;
    power *= corner * corner;
  }
  return sigma;
}

}  // namespace megablock
