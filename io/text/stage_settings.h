// The options of the stages as the project file states them, before the stages read them.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// Options of the stages, by the names of the project file. Defaults: see the option structs of the rooms; an unset
// value means "the room's default" so that defaults live in one place.
struct StageSettings {
  struct Entry {
    std::string section, key, value;  // e.g. "features", "max_features", "8000"
    std::string where;                // file:line, for messages
  };
  std::vector<Entry> entries;
};

}  // namespace megablock
