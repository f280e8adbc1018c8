#include "cluster/stages/split_test.h"

#include <fmt/core.h>

#include <cstdio>
#include <filesystem>
#include <vector>

#include "cluster/job/job_json.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/progress.h"
#include "cluster/process/signals.h"
#include "cluster/stages/pipeline.h"
#include "io/base/error.h"
#include "io/store/job/job_store.h"

namespace megablock {

namespace {

namespace fs = std::filesystem;

constexpr const char* kHalves = "halves";

// Links a file, or copies it where the file system has no links.
void link(const fs::path& from, const fs::path& to) {
  fs::create_directories(to.parent_path());
  std::error_code error;
  fs::create_hard_link(from, to, error);
  if (error) fs::copy_file(from, to, fs::copy_options::overwrite_existing);
}

// The files of all stages before the adjustment. A unit is never changed in place (job_store.h), so that links are
// safe.
void link_inputs(const JobStore& job, const std::string& to) {
  std::vector<std::string> files{"job.json", "block.h5"};
  for (const Stage& stage : all_stages()) {
    if (std::string(stage.name) == "adjustment") break;
    if (stage.folder().empty())
      files.emplace_back(stage.makes);
    else
      for (const std::string& unit : job.list(stage.folder())) files.push_back(unit);
  }
  for (const std::string& file : files)
    if (fs::exists(job.path(file))) link(job.path(file), fs::path(to) / file);
}

// One folder for each half: a further division replaces the one before it.
std::string folder_of(const std::string& job, Half half) {
  return (fs::path(job) / kHalves / std::to_string(static_cast<int>(half))).string();
}

void adjust_half(RunOptions options, const HalfChoice& choice, Communicator& ranks) {
  const std::string job = options.directory;
  options.directory = folder_of(job, choice.half);
  options.half = choice;
  on_first_rank(ranks, [&] {
    fs::remove_all(options.directory);
    link_inputs(JobStore(job), options.directory);
    JobStore(options.directory).create();
    return std::string();
  });
  run_job(options, ranks);
}

// "tie points, half 1, division 3 of 16"
std::string name_of(const HalfChoice& choice, std::int64_t divisions) {
  const bool first = choice.half == Half::kTiePoints1 || choice.half == Half::kImages1;
  if (choice.half == Half::kImages1 || choice.half == Half::kImages2)
    return fmt::format("images, half {}", first ? 1 : 2);
  return fmt::format("tie points, half {}, division {} of {}", first ? 1 : 2, choice.division + 1, divisions);
}

// Adjusts the halves one by one with a line for each. The messages of a job are those of a command that resumes it.
class Halves {
 public:
  Halves(const RunOptions& options, const SplitTestOptions& test, std::int64_t divisions, Communicator& ranks)
      : options_(options), ranks_(ranks), divisions_(divisions), quiet_(test.quiet) {}

  void adjust(const HalfChoice& choice) {
    const std::string name = name_of(choice, divisions_);
    ++number_;
    if (!quiet_ && ranks_.rank() == 0) {
      end_progress_line();
      std::fprintf(stderr, "%-12s %s\n", fmt::format("{}/{}", number_, 2 * divisions_ + 2).c_str(), name.c_str());
    }
    try {
      adjust_half(options_, choice, ranks_);
    } catch (const AgreedError<Interrupted>&) {
      throw AgreedError<Interrupted>("stopped as asked; the same command begins anew");
    } catch (const AgreedError<ComputeError>& error) {
      throw AgreedError<InputError>(
          name + ": the block has too few images or tie points to be divided, for this half gives no block (" +
          error.what() + "); compare the job with known poses ('megablock evaluate JOB POSES') or check points");
    }
  }

 private:
  const RunOptions& options_;
  Communicator& ranks_;
  std::int64_t divisions_, number_ = 0;
  bool quiet_;
};

BlockResult result_of(const std::string& job, Half half) {
  const JobStore store(folder_of(job, half));
  if (!store.seal(kResult))
    throw ComputeError(store.directory() + ": half of the observations does not give a block; see its log");
  return read_result_without_tracks(store.verified_path(kResult));
}

std::int64_t divisions_for(const JobStore& job) {
  constexpr std::int64_t kFewImages = 50, kOfFew = 16, kOfMany = 4;
  const auto generations = JobJson::of_job(job).value("generations", std::vector<std::int64_t>());
  return !generations.empty() && generations.back() <= kFewImages ? kOfFew : kOfMany;
}

}  // namespace

void SplitTestOptions::check() const {
  if (divisions < 0 || divisions > 1000) throw InputError("the number of divisions of a split test is 1 to 1000");
}

HalvesComparison run_split_test(const RunOptions& options, const SplitTestOptions& test, Communicator& ranks) {
  test.check();
  const std::string& job = options.directory;
  const std::int64_t count = test.divisions > 0 ? test.divisions : divisions_for(JobStore(job));
  work_begins_anew();
  Halves halves(options, test, count, ranks);
  std::vector<HalvesComparison> divisions;  // on the first rank
  for (std::int64_t division = 0; division < count; ++division) {
    for (const Half half : {Half::kTiePoints1, Half::kTiePoints2}) halves.adjust({half, division});
    on_first_rank(ranks, [&] {
      divisions.push_back(compare_halves(result_of(job, Half::kTiePoints1), result_of(job, Half::kTiePoints2)));
      return std::string();
    });
  }
  for (const Half half : {Half::kImages1, Half::kImages2}) halves.adjust({half, 0});
  HalvesComparison comparison;
  on_first_rank(ranks, [&] {
    comparison = mean_of(divisions);
    comparison.cameras_of_images = compare_cameras(result_of(job, Half::kImages1), result_of(job, Half::kImages2));
    fs::remove_all(fs::path(job) / kHalves);
    return std::string();
  });
  return comparison;
}

}  // namespace megablock
