// Writes the log of a job: a text file for each rank, <job>/log/<host>-<rank>.log.
//
// The console shows a person how far the job is. The log tells afterwards what happened on each rank: when stages and
// units began and ended, every warning of the console with its stage and unit, and every failure. A log that reaches
// its size limit is renamed to <host>-<rank>.1.log, and so on; the oldest one is deleted. The log is no part of the
// job's result: no fingerprint and no digest depends on it, and a log that cannot be written never stops a job.
//
// A line: "2026-11-26T23:20:02.123Z warning matching matches/000003.h5: the file is damaged; it is computed again".
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace megablock {

enum class LogLevel { kDebug, kInfo, kWarning, kError, kOff };

// The names "debug", "info", "warning", "error" and "off", in the order of LogLevel.
const std::vector<std::string>& log_level_names();
// The level of a name; empty for any other text.
std::optional<LogLevel> log_level_of(std::string_view name);

struct JobLogOptions {
  LogLevel level = LogLevel::kInfo;       // lines below this level are not written
  std::int64_t max_file_bytes = 8 << 20;  // size at which a log is renamed
  int max_old_files = 2;                  // renamed logs that are kept for each rank
  void check() const;                     // throws InputError
};

class JobLog {
 public:
  // A log that writes nothing.
  JobLog();
  // Appends to the log of this rank in `directory`, the job directory, and makes the folder `log` there. If that fails,
  // the log writes nothing and problem() says why.
  JobLog(const std::string& directory, int rank, const JobLogOptions& options = {});
  ~JobLog();
  JobLog(JobLog&&) noexcept;
  JobLog& operator=(JobLog&&) noexcept;

  // `stage` and `unit` may be empty. Lines of level info and above are in the file when the call returns. Any thread
  // may call it.
  void write(LogLevel level, std::string_view stage, std::string_view unit, std::string_view text) const;
  // Path of the file; empty when the log writes nothing.
  const std::string& path() const { return path_; }
  // Why the log could not be opened; empty when nothing went wrong.
  const std::string& problem() const { return problem_; }

 private:
  struct Logger;
  std::unique_ptr<Logger> logger_;
  std::string path_, problem_;
};

}  // namespace megablock
