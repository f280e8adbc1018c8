// Reads a YAML mapping key by key, with messages that name file and line. Internal to io/.
#pragma once

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>
#include <vector>

#include "io/text/plausible.h"

namespace megablock {

class YamlReader {
 public:
  // `node` must be a mapping without repeated keys; otherwise InputError. `context` is its name in messages, "" at the
  // top.
  YamlReader(YAML::Node node, std::string file, std::string context);

  // Each function declares a key and returns its value if there is one. Throws InputError for a value of the wrong
  // kind.
  std::optional<YAML::Node> node(const std::string& key);
  std::optional<double> number(const std::string& key);
  std::optional<double> number(const std::string& key, const Limits& limits);
  std::optional<bool> flag(const std::string& key);
  std::optional<std::string> text(const std::string& key);
  std::optional<std::vector<std::string>> texts(const std::string& key);  // a list
  std::optional<std::vector<double>> numbers(const std::string& key, std::size_t count);
  std::optional<YamlReader> mapping(const std::string& key);
  // A path, made absolute relative to the folder of the file. It must exist as a file, or as a folder.
  std::optional<std::string> existing_file(const std::string& key);
  std::optional<std::string> existing_folder(const std::string& key);

  std::vector<std::string> keys() const;
  void finish() const;  // throws InputError for keys that were not declared

  std::string where() const;                        // file and line of the mapping
  std::string where(const std::string& key) const;  // file and line of the key
  std::string absolute(const std::string& path) const;
  const std::string& file() const { return file_; }

 private:
  std::string scalar(const YAML::Node& value, const std::string& what) const;
  std::string full(const std::string& key) const { return context_.empty() ? key : context_ + "." + key; }

  YAML::Node node_;
  std::string file_, context_;
  std::vector<std::string> known_;
};

// Reads a file. Throws InputError with file:line for malformed YAML, and if the file cannot be read.
YamlReader read_yaml(const std::string& path);

}  // namespace megablock
