// Reads job.json (docs/reference/file-formats.md), which another program may have changed. An error is one line that
// names the file, the key and the remedy.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "io/project/project.h"
#include "io/store/job/job_store.h"

namespace megablock {

class JobJson {
 public:
  static constexpr int kVersion = 1;  // version that this program writes

  // `text` holds the contents of the file at `path`. Throws InputError when it is not a JSON object.
  JobJson(const std::string& path, const std::string& text);
  // Returns nothing when there is no file.
  static std::optional<JobJson> read(const JobStore& store);
  // Reads the file of a folder that must be a job. Throws InputError when it is none.
  static JobJson of_job(const JobStore& store);

  // Throws InputError when the file has another version.
  void check_version() const;
  // The settings of the project file as they were read. Throws InputError.
  StageSettings settings() const;

  // The value of a key that must be present. Throws InputError.
  template <typename Value>
  Value at(const std::string& key) const {
    if (!json_.contains(key)) refuse(key, "is missing");
    return converted<Value>(key);
  }
  // The value of a key, or `otherwise` when the key is missing. Throws InputError.
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
