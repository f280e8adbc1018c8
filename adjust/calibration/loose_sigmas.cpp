#include "adjust/calibration/loose_sigmas.h"

#include <algorithm>
#include <cmath>

namespace megablock {

namespace {

// Multiplied out, so that the result does not depend on the C library.
double power_of(double base, int exponent) {
  double power = exponent % 2 == 0 ? 1 : base;
  for (int i = 0; i < exponent / 2; ++i) power *= base * base;
  return power;
}

}  // namespace

IntrinsicSigmas loose_sigmas(const Intrinsics& start, int width, int height) {
  constexpr double kLooser = 10;
  IntrinsicSigmas sigma = weak_sigmas(start, 0, width);
  for (double& s : sigma) s *= kLooser;
  // weak_sigmas() refers to one focal length from the centre; the images of long lenses end far inside of it.
  const double corner = std::min(1.0, 0.5 * std::hypot(width, height) / start[kFocal]);
  const std::vector<CameraParameter>& parameters = camera_parameters(start.model());
  for (std::size_t p = 0; p < parameters.size(); ++p)
    // A radial term of degree d grows with r^d. Divided by (corner radius)^d the sigma means the same correction at the
    // corner for every focal length.
    if (parameters[p].role == ParameterRole::kRadial) sigma[p] /= power_of(corner, parameters[p].degree);
  return sigma;
}

}  // namespace megablock
