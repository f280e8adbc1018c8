#include "adjust/coplanarity/coplanarity_network.h"

#include <fmt/core.h>

#include <cmath>
#include <set>

#include "adjust/coplanarity/coplanarity_equations.h"
#include "io/base/error.h"

namespace megablock {

void CoplanarityNetwork::check() const {
  const auto require = [](bool holds, const std::string& what) {
    if (!holds) throw InputError("coplanarity: " + what);
  };
  require(focal_px > 0, "the focal length must be positive (pixels)");
  require(centres.size() == angles.size() && centres.size() >= 2, "two cameras with positions and angles are needed");
  require(!begin.empty() && begin.front() == 0 && begin.back() == std::ssize(camera) && camera.size() == image.size(),
          "the tables of points and observations differ in length");
  require(angles_held.empty() || angles_held.size() == 3 * angles.size(), "angles_held needs three entries per camera");
  require(images_held.empty() || images_held.size() == 2 * image.size(),
          "images_held needs two entries per observation");
  for (std::size_t i = 0; i < centres.size(); ++i)
    require(centres[i].allFinite() && std::isfinite(angles[i].alpha + angles[i].beta + angles[i].gamma),
            fmt::format("camera {} has a position or angle that is not a number", i));
  for (std::size_t j = 0; j + 1 < begin.size(); ++j) {
    std::set<std::int32_t> seen;
    require(begin[j] <= begin[j + 1], fmt::format("point {} ends before it begins", j));
    for (auto o = static_cast<std::size_t>(begin[j]); o < static_cast<std::size_t>(begin[j + 1]); ++o) {
      require(camera[o] >= 0 && static_cast<std::size_t>(camera[o]) < centres.size(),
              fmt::format("point {} names camera {}, which is not there", j, camera[o]));
      require(image[o].allFinite(), fmt::format("point {} has a coordinate that is not a number", j));
      require(seen.insert(camera[o]).second, fmt::format("point {} is seen twice by camera {}", j, camera[o]));
    }
  }
  require(pair_count(*this) > 0, "no point is seen by two cameras");
  for (std::size_t a = 0; a < centres.size(); ++a)
    for (std::size_t b = a + 1; b < centres.size(); ++b)
      // Two cameras at one place have no base: their determinant is zero for any rays.
      require(centres[a] != centres[b], fmt::format("cameras {} and {} stand at the same place", a, b));
}

}  // namespace megablock
