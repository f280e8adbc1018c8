#include "io/project/inputs/camera_priors.h"

namespace megablock {

IntrinsicSigmas default_intrinsic_sigmas(const Camera& camera) {
  return weak_sigmas(camera.intrinsics, camera.intrinsics[kFocal] * (camera.focal_known ? 0.05 : 0.3), camera.width);
}

}  // namespace megablock
