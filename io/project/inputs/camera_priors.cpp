#include "io/project/inputs/camera_priors.h"

#include <algorithm>

namespace megablock {

double usual_focal_px(int width, int height) { return 1.2 * std::max(width, height); }

IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera) {
  return default_intrinsic_sigmas(camera, usual_parameters(camera.intrinsics.model()));
}

IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera, ParameterMask which) {
  const double focal_sigma = camera.intrinsics[kFocal] * (camera.focal_known ? 0.05 : 0.3);
  return weak_sigmas(camera.intrinsics, focal_sigma, camera.width, which);
}

}  // namespace megablock
