#include "io/simulate/scene/published_cameras.h"

namespace megablock {

const std::vector<PublishedCamera>& published_cameras() {
  constexpr CameraModel ign{CameraModelKind::kIgnRadial, 0};
  static const std::vector<PublishedCamera> cameras = {
      {"consumer 20 mm", 3000, 2008, {ign, {2610, 1498, 985, 1481, 971, -1.7e-8, 3e-15, -2.2e-22}}, 59.7},
      {"consumer 50 mm", 3000, 2008, {ign, {6627, 1511, 985, 1721, 1145, -6.2e-10, 6.1e-17, -8.2e-24}}, 4.2},
      {"HD", 1920, 1080, {ign, {1400, 961, 542, 961, 542, -4.6e-8, 3.1e-14, -1.2e-21}}, 14.9},
      {"aerial", 7256, 5450, {ign, {11775, 3657, 2728, 3697, 2709, -2.8e-11, -4.2e-19, 9.7e-27}}, 3.1}};
  return cameras;
}

}  // namespace megablock
