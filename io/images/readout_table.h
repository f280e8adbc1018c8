// Looks up the readout times of well-known cameras with a rolling shutter (readout_times.csv; its head states the
// source).
#pragma once

#include <optional>
#include <string>

namespace megablock {

// From the first row to the last, seconds. `make` and `model` are those of EXIF. Some cameras read images of more
// pixels more slowly. Empty if the table does not have the camera.
std::optional<double> readout_time_s(const std::string& make, const std::string& model, double megapixels);

}  // namespace megablock
