// Looks up the sensor widths of well-known cameras. They turn a focal length in millimetres into one in pixels.
//
// The table (sensor_widths.csv, about 3 800 cameras; camera_table.h) joins makers' data sheets with the public tables of
// COLMAP and OpenSfM; its head states the sources and licences, and make_sensor_widths.py makes it.
#pragma once

#include <optional>
#include <string>

namespace megablock {

// Width of the sensor along its larger side, mm. `make` and `model` are those of EXIF ("NIKON CORPORATION", "NIKON
// D800"). Empty if the table does not have the camera.
std::optional<double> sensor_width_mm(const std::string& make, const std::string& model);

}  // namespace megablock
