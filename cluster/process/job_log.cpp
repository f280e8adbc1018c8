#include "cluster/process/job_log.h"

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr spdlog::level::level_enum kSpdlogLevels[] = {spdlog::level::debug, spdlog::level::info, spdlog::level::warn,
                                                       spdlog::level::err, spdlog::level::off};

spdlog::level::level_enum spdlog_level(LogLevel level) { return kSpdlogLevels[static_cast<int>(level)]; }

std::string host_name() {
  char name[256] = {};
  if (gethostname(name, sizeof name - 1) != 0 || name[0] == '\0') return "host";
  std::string host(name);
  std::replace(host.begin(), host.end(), '/', '_');
  return host;
}

std::string log_line(std::string_view stage, std::string_view unit, std::string_view text) {
  std::string line(stage);
  for (const std::string_view part : {unit, text}) {
    if (part.empty()) continue;
    if (!line.empty()) line += part.data() == text.data() && !unit.empty() ? ": " : " ";
    line += part;
  }
  // A message of several lines stays one record, on one line.
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

}  // namespace

const std::vector<std::string>& log_level_names() {
  static const std::vector<std::string> names = {"debug", "info", "warning", "error", "off"};
  return names;
}

std::optional<LogLevel> log_level_of(std::string_view name) {
  const auto& names = log_level_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<LogLevel>(found - names.begin());
}

void JobLogOptions::check() const {
  if (max_file_bytes < 1024) throw InputError("the size limit of a log must be at least 1024 bytes");
  if (max_old_files < 0 || max_old_files > 1000) throw InputError("the number of old logs must be 0 to 1000");
}

struct JobLog::Logger {
  explicit Logger(spdlog::sink_ptr sink) : log("", std::move(sink)) {}
  spdlog::logger log;
};

JobLog::JobLog() = default;
JobLog::~JobLog() = default;
JobLog::JobLog(JobLog&&) noexcept = default;
JobLog& JobLog::operator=(JobLog&&) noexcept = default;

JobLog::JobLog(const std::string& directory, int rank, const JobLogOptions& options) {
  options.check();
  if (options.level == LogLevel::kOff) return;
  const std::string path = directory + "/log/" + host_name() + "-" + std::to_string(rank) + ".log";
  try {
    std::filesystem::create_directories(directory + "/log");
    auto sink = std::make_shared<spdlog::sinks::rotating_file_sink_mt>(
        path, static_cast<std::size_t>(options.max_file_bytes), static_cast<std::size_t>(options.max_old_files));
    logger_ = std::make_unique<Logger>(std::move(sink));
  } catch (const std::exception& error) {
    problem_ = error.what();
    return;
  }
  path_ = path;
  spdlog::logger& log = logger_->log;
  log.set_formatter(
      std::make_unique<spdlog::pattern_formatter>("%Y-%m-%dT%H:%M:%S.%eZ %l %v", spdlog::pattern_time_type::utc));
  log.set_level(spdlog_level(options.level));
  log.flush_on(spdlog::level::info);
  // A full disk must not stop the job, nor fill the console with a message for each line.
  log.set_error_handler([](const std::string&) {});
}

void JobLog::write(LogLevel level, std::string_view stage, std::string_view unit, std::string_view text) const {
  if (!logger_ || level == LogLevel::kOff) return;
  const auto at = spdlog_level(level);
  if (logger_->log.should_log(at)) logger_->log.log(at, spdlog::string_view_t(log_line(stage, unit, text)));
}

}  // namespace megablock
