// A YAML mapping read key by key, with messages that name file and line. Internal to io/.
#pragma once

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>
#include <vector>

#include "io/text/plausible.h"

namespace megablock {

class YamlReader {
 public:
  // `node` must be a mapping without repeated keys (InputError otherwise); `context` names it in messages ("" at top).
  YamlReader(YAML::Node node, std::string file, std::string context);

  // Each declares a key and gives its value when it is there.
  std::optional<YAML::Node> node(const std::string& key);
  std::optional<double> number(const std::string& key);
  std::optional<double> number(const std::string& key, const Limits& limits);
  std::optional<bool> flag(const std::string& key);
  std::optional<std::string> text(const std::string& key);
  std::optional<std::vector<std::string>> texts(const std::string& key);  // a list
  std::optional<std::vector<double>> numbers(const std::string& key, std::size_t count);
  std::optional<YamlReader> mapping(const std::string& key);
  // A path, made absolute against the folder of the file; must exist as a file (or folder).
  std::optional<std::string> existing_file(const std::string& key);
  std::optional<std::string> existing_folder(const std::string& key);

  std::vector<std::string> keys() const;
  void finish() const;  // InputError for keys never declared

  std::string where() const;                        // of the mapping
  std::string where(const std::string& key) const;  // of the key's value
  std::string absolute(const std::string& path) const;
  const std::string& file() const { return file_; }

 private:
  std::string scalar(const YAML::Node& value, const std::string& what) const;
  std::string full(const std::string& key) const { return context_.empty() ? key : context_ + "." + key; }

  YAML::Node node_;
  std::string file_, context_;
  std::vector<std::string> known_;
};

// Parses a file; InputError with file:line for malformed YAML or when it cannot be read.
YamlReader read_yaml(const std::string& path);

}  // namespace megablock
