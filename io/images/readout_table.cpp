#include "io/images/readout_table.h"

#include "io/images/camera_table.h"
#include "io/readout_times.h"

namespace megablock {

std::optional<double> readout_time_s(const std::string& make, const std::string& model, double megapixels) {
  static const CameraTable table(kReadoutTimes);
  const std::optional<double> ms = table.find(make, model, megapixels);
  return ms ? std::optional(*ms / 1000) : std::nullopt;
}

}  // namespace megablock
