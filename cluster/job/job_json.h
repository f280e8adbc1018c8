// job.json (docs/reference/file-formats.md) as another program may have left it: what cannot be read is said in one
// line, with the file, the key and what to do.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "io/project/project.h"
#include "io/store/job/job_store.h"

namespace megablock {

class JobJson {
 public:
  static constexpr int kVersion = 1;  // of what this program writes

  // `text` of the file at `path`. Throws InputError where it is no JSON object.
  JobJson(const std::string& path, const std::string& text);
  // Empty: there is no file.
  static std::optional<JobJson> read(const JobStore& store);
  // Of a folder that must be a job; else InputError.
  static JobJson of_job(const JobStore& store);

  // Throws InputError for another version.
  void check_version() const;
  // The project file's settings as they were read. Throws InputError.
  StageSettings settings() const;

  // Of a key that must be there. Throws InputError.
  template <typename Value>
  Value at(const std::string& key) const {
    if (!json_.contains(key)) refuse(key, "is missing");
    return converted<Value>(key);
  }
  // Of a key that may be missing. Throws InputError.
  template <typename Value>
  Value value(const std::string& key, const Value& otherwise) const {
    return json_.contains(key) ? converted<Value>(key) : otherwise;
  }

 private:
  [[noreturn]] void refuse(const std::string& key, const std::string& why) const;

  template <typename Value>
  Value converted(const std::string& key) const {
    try {
      return json_.at(key).get<Value>();
    } catch (const nlohmann::json::exception&) {
      refuse(key, "has another form than here");
    }
  }

  std::string path_;
  nlohmann::json json_;
};

}  // namespace megablock
