// Writes numbers with the noun that they count.
#pragma once

#include <cstdint>
#include <string>

namespace megablock {

// "1 tile", "4 tiles". For nouns whose plural ends in s.
inline std::string counted(std::int64_t number, const std::string& noun) {
  return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

}  // namespace megablock
