#include "io/images/sensor_table.h"

#include "io/images/camera_table.h"
#include "io/sensor_widths.h"

namespace megablock {

std::optional<double> sensor_width_mm(const std::string& make, const std::string& model) {
  static const CameraTable table(kSensorWidths);
  return table.find(make, model);
}

}  // namespace megablock
