// Holds the options of the stages as written in the project file, before the stages read them.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// Options by their names in the project file. An option that is not set has the default of the option struct of its
// room; in this way each default has only one place.
struct StageSettings {
  struct Entry {
    std::string section, key, value;  // e.g. "features", "max_features", "8000"
    std::string where;                // file:line, for messages
  };
  std::vector<Entry> entries;
};

// A section with such options.
struct SettingsSection {
  std::string name;
  std::string file_key;       // the key that names a file; empty: none
  bool needs_images = false;  // not used with given tie points
};

}  // namespace megablock
