#include "io/project/named_files.h"

#include <filesystem>

#include "io/text/yaml_reader.h"

namespace megablock {

namespace {

// Collects every value that is the path of an existing file. The meaning of the keys is known only where they are read,
// so any value may name a file.
void collect(const YAML::Node& node, const YamlReader& project, const std::string& made,
             std::vector<std::string>& files) {
  if (node.IsScalar() && !node.Scalar().empty()) {
    std::error_code error;
    const std::string path = project.absolute(node.Scalar());
    if (std::filesystem::exists(path, error)) files.push_back(path);
  }
  if (node.IsSequence())
    for (const YAML::Node& item : node) collect(item, project, made, files);
  if (node.IsMap())
    for (const auto& item : node)
      if (!item.first.IsScalar() || item.first.Scalar() != made) collect(item.second, project, made, files);
}

}  // namespace

std::vector<std::string> files_named_in(const std::string& project, const std::string& made) {
  YamlReader reader = read_yaml(project);
  std::vector<std::string> files;
  for (const std::string& key : reader.keys())
    if (key != made) collect(*reader.node(key), reader, made, files);
  return files;
}

}  // namespace megablock
