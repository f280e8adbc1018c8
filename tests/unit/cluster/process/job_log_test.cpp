#include "cluster/process/job_log.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <thread>

#include "cluster/commands/calibrate_command.h"
#include "cluster/process/save_times.h"
#include "io/base/error.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

TEST(JobLog, WritesTimeLevelStageUnitAndText) {
  const ScratchDirectory folder;
  const JobLog log(folder.path(), 3);
  log.write(LogLevel::kWarning, "matching", "matches/000003.h5", "the file is damaged");
  log.write(LogLevel::kInfo, "merge", "", "iteration 1");
  log.write(LogLevel::kError, "", "", "two\nlines");
  const auto lines = lines_of(log.path());
  ASSERT_EQ(lines.size(), 3u);
  const std::string time = R"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z )";
  EXPECT_TRUE(std::regex_match(lines[0], std::regex(time + "warning matching matches/000003.h5: the file is damaged")));
  EXPECT_TRUE(std::regex_match(lines[1], std::regex(time + "info merge iteration 1")));
  EXPECT_TRUE(std::regex_match(lines[2], std::regex(time + "error two lines")));
  EXPECT_THAT(log.path(), testing::EndsWith("-3.log"));
}

TEST(JobLog, LeavesOutLinesBelowItsLevel) {
  const ScratchDirectory folder;
  JobLogOptions options;
  options.level = LogLevel::kWarning;
  const JobLog log(folder.path(), 0, options);
  log.write(LogLevel::kInfo, "tiles", "", "begins");
  log.write(LogLevel::kWarning, "tiles", "", "one image has no link");
  EXPECT_THAT(lines_of(log.path()), testing::ElementsAre(testing::HasSubstr("one image has no link")));
}

TEST(JobLog, AppendsWhenTheJobIsResumed) {
  const ScratchDirectory folder;
  for (int run = 0; run < 2; ++run) JobLog(folder.path(), 0).write(LogLevel::kInfo, "features", "", "begins");
  EXPECT_EQ(lines_of(JobLog(folder.path(), 0).path()).size(), 2u);
}

TEST(JobLog, KeepsWithinItsSize) {
  const ScratchDirectory folder;
  JobLogOptions options;
  options.max_file_bytes = 4096;
  options.max_old_files = 2;
  const JobLog log(folder.path(), 0, options);
  for (int n = 0; n < 1000; ++n) log.write(LogLevel::kInfo, "features", "", "image " + std::to_string(n));
  std::uintmax_t bytes = 0, files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path() + "/log")) {
    bytes += entry.file_size();
    ++files;
  }
  EXPECT_EQ(files, 3u);
  EXPECT_LE(bytes, 3u * 4096u);
  EXPECT_THAT(lines_of(log.path()).back(), testing::HasSubstr("image 999"));
}

TEST(JobLog, TakesLinesOfSeveralThreadsWhole) {
  const ScratchDirectory folder;
  const JobLog log(folder.path(), 0);
  const auto write = [&](char letter) {
    for (int n = 0; n < 200; ++n) log.write(LogLevel::kInfo, "", "", std::string(100, letter));
  };
  std::thread other(write, 'a');
  write('b');
  other.join();
  const auto lines = lines_of(log.path());
  ASSERT_EQ(lines.size(), 400u);
  for (const std::string& line : lines)
    EXPECT_THAT(line, testing::AnyOf(testing::EndsWith(" " + std::string(100, 'a')),
                                     testing::EndsWith(" " + std::string(100, 'b'))));
}

TEST(JobLog, NeverStopsAJob) {
  const ScratchDirectory folder;
  std::ofstream(folder.path() + "/log") << "a file stands where the folder should be";
  const JobLog log(folder.path(), 0);
  log.write(LogLevel::kError, "features", "", "nobody reads this");
  EXPECT_EQ(log.path(), "");
  EXPECT_NE(log.problem(), "");
  JobLog().write(LogLevel::kError, "features", "", "nor this");
}

TEST(JobLog, KnowsItsLevelsByName) {
  for (const std::string& name : log_level_names())
    EXPECT_EQ(log_level_names()[static_cast<std::size_t>(*log_level_of(name))], name);
  EXPECT_EQ(log_level_of("warning"), LogLevel::kWarning);
  EXPECT_FALSE(log_level_of("loud"));
  JobLogOptions options;
  options.max_file_bytes = 10;
  EXPECT_THROW(options.check(), InputError);
}

}  // namespace
}  // namespace megablock
