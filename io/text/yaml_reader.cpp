// A key counts as known once a reader has asked for it, so finish() needs no list of keys that could go out of date. It
// refuses all others: a misspelled key would otherwise be ignored without a word.
#include "io/text/yaml_reader.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

std::string position(const std::string& file, const YAML::Mark& mark) {
  // yaml-cpp counts lines from 0, people from 1.
  return file + ":" + std::to_string(mark.is_null() ? 1 : mark.line + 1);
}

}  // namespace

YamlReader::YamlReader(YAML::Node node, std::string file, std::string context)
    : node_(std::move(node)), file_(std::move(file)), context_(std::move(context)) {
  const std::string name = context_.empty() ? "the project file" : "'" + context_ + "'";
  if (node_.IsNull()) return;  // an empty section
  if (!node_.IsMap()) throw InputError(where() + ": " + name + " must be a mapping (lines of 'key: value')");
  std::set<std::string> seen;
  for (const auto& item : node_) {
    if (!item.first.IsScalar()) throw InputError(position(file_, item.first.Mark()) + ": a key must be a plain word");
    // yaml-cpp accepts repeated keys, of which only one would be used.
    if (!seen.insert(item.first.Scalar()).second)
      throw InputError(position(file_, item.first.Mark()) + ": key '" + item.first.Scalar() + "' appears twice in " +
                       name);
  }
}

std::string YamlReader::where() const { return position(file_, node_.Mark()); }

std::string YamlReader::where(const std::string& key) const {
  for (const auto& item : node_)
    if (item.first.Scalar() == key) return position(file_, item.first.Mark());
  return where();
}

std::vector<std::string> YamlReader::keys() const {
  std::vector<std::string> result;
  for (const auto& item : node_) result.push_back(item.first.Scalar());
  return result;
}

std::optional<YAML::Node> YamlReader::node(const std::string& key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  for (const auto& item : node_)
    if (item.first.Scalar() == key) return YAML::Node(item.second);
  return std::nullopt;
}

std::string YamlReader::scalar(const YAML::Node& value, const std::string& what) const {
  if (!value.IsScalar())
    throw InputError(position(file_, value.Mark()) + ": " + what +
                     (value.IsNull() ? " has no value" : " must be one plain value"));
  return value.Scalar();
}

std::optional<std::string> YamlReader::text(const std::string& key) {
  const auto value = node(key);
  if (!value) return std::nullopt;
  if (value->IsNull()) throw InputError(where(key) + ": " + full(key) + " has no value");
  return scalar(*value, full(key));
}

std::optional<double> YamlReader::number(const std::string& key) {
  const auto value = text(key);
  return value ? std::optional(parse_number(*value, full(key), where(key))) : std::nullopt;
}

std::optional<double> YamlReader::number(const std::string& key, const Limits& limits) {
  const auto value = number(key);
  if (value) check_within(*value, limits, full(key), where(key));
  return value;
}

std::optional<bool> YamlReader::flag(const std::string& key) {
  const auto value = text(key);
  return value ? std::optional(parse_flag(*value, full(key), where(key))) : std::nullopt;
}

std::optional<std::vector<double>> YamlReader::numbers(const std::string& key, std::size_t count) {
  const auto value = node(key);
  if (!value) return std::nullopt;
  if (!value->IsSequence() || value->size() != count)
    throw InputError(where(key) + ": " + full(key) + " must be a list of " + std::to_string(count) + " numbers");
  std::vector<double> result;
  for (const auto& item : *value)
    result.push_back(parse_number(scalar(item, full(key)), full(key), position(file_, item.Mark())));
  return result;
}

std::optional<std::vector<std::string>> YamlReader::texts(const std::string& key) {
  const auto value = node(key);
  if (!value) return std::nullopt;
  if (!value->IsSequence()) throw InputError(where(key) + ": " + full(key) + " must be a list");
  std::vector<std::string> result;
  for (const auto& item : *value) result.push_back(scalar(item, full(key)));
  return result;
}

std::optional<YamlReader> YamlReader::mapping(const std::string& key) {
  const auto value = node(key);
  if (!value) return std::nullopt;
  return YamlReader(*value, file_, full(key));
}

std::string YamlReader::absolute(const std::string& path) const {
  const fs::path given(path);
  // Relative to the project file, not to the present folder, so that a project can be run from anywhere.
  return (given.is_absolute() ? given : fs::absolute(file_).parent_path() / given).lexically_normal().string();
}

std::optional<std::string> YamlReader::existing_file(const std::string& key) {
  const auto value = text(key);
  if (!value) return std::nullopt;
  const std::string path = absolute(*value);
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    throw InputError(where(key) + ": " + full(key) + ": file '" + path + "' does not exist");
  return path;
}

std::optional<std::string> YamlReader::existing_folder(const std::string& key) {
  const auto value = text(key);
  if (!value) return std::nullopt;
  const std::string path = absolute(*value);
  std::error_code error;
  if (!fs::is_directory(path, error))
    throw InputError(where(key) + ": " + full(key) + ": folder '" + path + "' does not exist");
  return path;
}

void YamlReader::finish() const {
  for (const std::string& key : keys())
    if (std::find(known_.begin(), known_.end(), key) == known_.end())
      throw InputError(where(key) + ": " + unknown_key_message(key, context_, known_));
}

YamlReader read_yaml(const std::string& path) {
  const std::ifstream stream = open_input(path);
  std::ostringstream text;
  text << stream.rdbuf();
  try {
    return YamlReader(YAML::Load(text.str()), path, "");
  } catch (const YAML::Exception& error) {
    throw InputError(position(path, error.mark) + ": not valid YAML: " + error.msg);
  }
}

}  // namespace megablock
