#include "io/block/frame_measurements.h"

#include <vector>

namespace megablock {

std::span<const FrameMeasurementType> frame_measurement_types() {
  // The best distances of a survey are known to 1e-7 of their length. Below 1e-9 the square of a weighted distance,
  // 1e18, loses the residuals of all other observations in its rounding. With a sigma as long as itself a distance says
  // nothing of the scale.
  static const std::vector<FrameMeasurementType> types{
      {"distances", "distance_m", "sigma_m", {1e-6, 1e8}, kSigmaMetres, {1e-9, 1}}};
  return types;
}

}  // namespace megablock
