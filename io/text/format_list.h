// Finds a file format by its name, for exports and imports. Internal to io/.
#pragma once

#include <string>
#include <vector>

#include "io/base/error.h"

namespace megablock {

template <typename Format>
std::vector<std::string> names_of(const std::vector<Format>& formats) {
  std::vector<std::string> names;
  for (const Format& format : formats) names.push_back(format.name);
  return names;
}

// The format of this name. Throws InputError with a list of all names if there is none; `kind` is "export" or "import".
template <typename Format>
const Format& format_named(const std::vector<Format>& formats, const std::string& name, const std::string& kind) {
  std::string list;
  for (const Format& format : formats) {
    if (format.name == name) return format;
    list += (list.empty() ? "" : ", ") + format.name;
  }
  throw InputError("'" + name + "' is not an " + kind + " format; the formats are " + list);
}

}  // namespace megablock
