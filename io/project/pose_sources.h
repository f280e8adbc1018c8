// Tells the user where positions and attitudes of the images come from, and with which sigmas. Internal to io/.
#pragma once

#include <string>
#include <vector>

#include "io/project/image_scan.h"

namespace megablock {

// Lines such as "positions: 95 of 100 images from EXIF, RTK fixed, sigma 0.011 to 0.024 m, vertical 0.03 m". Sources
// are in the order of their names. `position_sigmas_m`: [scanned] horizontal, vertical; NaN where no position is used.
std::vector<std::string> lines_of_positions(const std::vector<ScannedImage>& scanned,
                                            const std::vector<Eigen::Vector2d>& position_sigmas_m);
// `used`: [scanned] whether the attitude is used. Sigmas in degrees.
std::vector<std::string> lines_of_attitudes(const std::vector<ScannedImage>& scanned, const std::vector<bool>& used,
                                            double tilt_sigma_deg, double heading_sigma_deg);

}  // namespace megablock
