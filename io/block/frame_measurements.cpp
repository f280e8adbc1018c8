#include "io/block/frame_measurements.h"

#include <vector>

namespace megablock {

std::span<const FrameMeasurementType> frame_measurement_types() {
  static const std::vector<FrameMeasurementType> types{{"distances", "distance_m", "sigma_m", true}};
  return types;
}

}  // namespace megablock
