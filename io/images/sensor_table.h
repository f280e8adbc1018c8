// Sensor widths of well-known cameras, from which a focal length in mm becomes one in pixels.
//
// The table (sensor_widths.csv, about 3 800 cameras) joins makers' data sheets with the public table of COLMAP; its
// head states the sources and licences, and make_sensor_widths.py makes it. Programs write the same camera with other
// spaces, hyphens and capitals, so only letters and digits are compared.
#pragma once

#include <optional>
#include <string>

namespace megablock {

// Width along the larger side of the sensor, mm. `make` and `model` as in EXIF ("NIKON CORPORATION", "NIKON D800");
// empty when the camera is not in the table.
std::optional<double> sensor_width_mm(const std::string& make, const std::string& model);

}  // namespace megablock
