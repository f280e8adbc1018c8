#include "cluster/stages/split_test.h"

#include <filesystem>
#include <vector>

#include "cluster/job/job_json.h"
#include "cluster/mpi/collective.h"
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
  std::vector<HalvesComparison> divisions;  // on the first rank
  for (std::int64_t division = 0; division < count; ++division) {
    for (const Half half : {Half::kTiePoints1, Half::kTiePoints2}) adjust_half(options, {half, division}, ranks);
    on_first_rank(ranks, [&] {
      divisions.push_back(compare_halves(result_of(job, Half::kTiePoints1), result_of(job, Half::kTiePoints2)));
      return std::string();
    });
  }
  for (const Half half : {Half::kImages1, Half::kImages2}) adjust_half(options, {half, 0}, ranks);
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
