#include "io/text/side_text.h"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <vector>

namespace megablock {

std::string side_text(const Eigen::Vector3d& offset) {
  constexpr std::array<std::array<const char*, 2>, 3> kSides{
      {{"east of", "west of"}, {"north of", "south of"}, {"above", "below"}}};
  std::vector<std::string> parts;
  for (int k = 0; k < 3; ++k)
    if (offset[k] != 0)
      parts.push_back(
          fmt::format("{:.2f} m {}", std::abs(offset[k]), kSides[static_cast<std::size_t>(k)][offset[k] < 0 ? 1 : 0]));
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i)
    text += (i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ") + parts[i];
  return text;
}

}  // namespace megablock
