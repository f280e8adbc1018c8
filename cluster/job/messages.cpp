#include "cluster/job/messages.h"

#include <cstdio>

#include "cluster/process/progress.h"

namespace megablock {

namespace {

constexpr std::size_t kStageWidth = 13;  // width of the column of stage names on the console

void print_line(const std::string& stage, const std::string& text) {
  std::string line = stage;
  line.resize(std::max(kStageWidth, line.size() + 1), ' ');
  end_progress_line();
  std::fprintf(stderr, "%s%s\n", line.c_str(), text.c_str());
}

}  // namespace

void say(const Job& job, const std::string& stage, const std::string& text) {
  if (job.is_first_rank() && !job.options.quiet) print_line(stage, text);
  job.log.write(LogLevel::kInfo, stage, "", text);
}

void warn(const Job& job, const std::string& stage, const std::string& text) {
  print_line(stage, "warning: " + text);
  job.log.write(LogLevel::kWarning, stage, "", text);
}

void add_note(const Job& job, JobRecord& record, const std::string& stage, const std::string& text) {
  record.notes.push_back(text);
  job.log.write(LogLevel::kWarning, stage, "", text);
}

void warn_of_damage(const JobStore& store, const JobLog& log, const std::string& stage, const std::string& unit,
                    const std::string& problem) {
  end_progress_line();
  std::fprintf(stderr, "megablock: warning: %s: %s; it is computed again\n", store.path(unit).c_str(), problem.c_str());
  log.write(LogLevel::kWarning, stage, unit, problem + "; it is computed again");
}

}  // namespace megablock
