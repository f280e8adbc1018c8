#include "cluster/job/job_json.h"

#include <fmt/core.h>

#include <array>
#include <fstream>
#include <iterator>

#include "cluster/process/version.h"
#include "io/base/error.h"

namespace megablock {

JobJson::JobJson(const std::string& path, const std::string& text)
    : path_(path), json_(nlohmann::json::parse(text, nullptr, false)) {
  if (!json_.is_object()) throw InputError(path + ": is not readable; restore it or start a new job directory");
}

std::optional<JobJson> JobJson::read(const JobStore& store) {
  std::ifstream in(store.path("job.json"));
  if (!in) return std::nullopt;
  return JobJson(store.path("job.json"), std::string(std::istreambuf_iterator<char>(in), {}));
}

JobJson JobJson::of_job(const JobStore& store) {
  if (std::optional<JobJson> job = read(store)) return *job;
  throw InputError(store.directory() + ": is not a job directory (no job.json); name the folder given to 'run -j'");
}

void JobJson::check_version() const {
  const int version = value("version", 0);
  if (version != kVersion)
    throw InputError(
        fmt::format("{}: job of version {}, this program writes version {}; finish it with the program that began it, "
                    "or start a new "
                    "job directory",
                    path_, version, kVersion));
}

StageSettings JobJson::settings() const {
  StageSettings settings;
  for (const auto& [section, key, value, where] : at<std::vector<std::array<std::string, 4>>>("settings"))
    settings.entries.push_back({section, key, value, where});
  return settings;
}

void JobJson::refuse(const std::string& key, const std::string& why) const {
  const auto said = json_.find("program");
  const std::string program = said != json_.end() && said->is_string() ? said->get<std::string>() : "another version";
  if (program == kProgram)
    throw InputError(
        fmt::format("{}: the key '{}' {}; restore the file, or start a new job directory", path_, key, why));
  throw InputError(
      fmt::format("{}: the key '{}' {}: {} wrote this job, this is {}; finish it with the program that began it, or "
                  "start a new job directory",
                  path_, key, why, program, kProgram));
}

}  // namespace megablock
