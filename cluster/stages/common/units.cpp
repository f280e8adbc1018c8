#include "cluster/stages/common/units.h"

#include <cstdio>

namespace megablock {

std::string unit_name(const std::string& folder, std::int64_t number) {
  char text[32];
  std::snprintf(text, sizeof text, "/%06lld.h5", static_cast<long long>(number));
  return folder + text;
}

}  // namespace megablock
