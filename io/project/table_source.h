// Reads the keys that the sections `positions` and `trajectory` of the project file have in common: a file of another
// program, and what the project says of it. Internal to io/.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/project/image_scan.h"
#include "io/project/positions/exposures.h"
#include "io/project/positions/position_table.h"
#include "io/text/yaml_reader.h"

namespace megablock {

// Reads `file`, which must be there, `images`, `format`, `crs`, `accuracy`, `columns`, the sigmas and `time_offset_s`.
void read_table_source(YamlReader& reader, const std::string& section, TableSource& source);

// What the header of an image says of its time.
ImageTime time_of_image(const ScannedImage& image);

// Reads a section that is a file, a mapping, or a list of these. `read` makes a Source, which derives from TableSource,
// of a mapping.
template <typename Source, typename Read>
std::vector<Source> read_table_sources(YamlReader& top, const std::string& section, const Read& read) {
  std::vector<Source> sources;
  const auto add = [&](const YAML::Node& item) {
    if (item.IsMap()) {
      sources.push_back(read(YamlReader(item, top.file(), section)));
      return;
    }
    Source source;
    source.where = top.where(section);
    if (!item.IsScalar())
      throw InputError(source.where + ": " + section + " must be a file, a mapping with 'file', or a list of these");
    source.path = top.absolute(item.Scalar());
    if (!std::filesystem::is_regular_file(source.path))
      throw InputError(source.where + ": " + section + ": file '" + item.Scalar() + "' does not exist; check the path");
    sources.push_back(source);
  };
  const auto node = top.node(section);
  if (node && node->IsSequence())
    for (const YAML::Node& item : *node) add(item);
  else if (node)
    add(*node);
  return sources;
}

}  // namespace megablock
