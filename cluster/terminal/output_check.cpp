#include "cluster/terminal/output_check.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "cluster/job/job_json.h"
#include "cluster/outcome/diagnostics.h"
#include "cluster/outcome/result_figures.h"
#include "io/base/error.h"
#include "io/images/image_header.h"
#include "io/project/named_files.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

// The path with links followed as far as it exists, and without a slash at the end.
fs::path place_of(const std::string& path) {
  const fs::path whole = (fs::absolute(path) / "").lexically_normal().parent_path();
  std::error_code error;
  const fs::path place = fs::weakly_canonical(whole, error);
  return error ? whole : place;
}

bool lies_below(const fs::path& place, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), place.begin(), place.end()).first == folder.end();
}

bool takes_place_of(const fs::path& output, const std::string& input) {
  std::error_code error;
  if (!fs::is_directory(input, error)) return fs::equivalent(output, input, error);
  return fs::exists(output, error) && is_image_name(output.string()) && lies_below(output, place_of(input));
}

// The innermost job directory that is the output or contains it.
std::optional<fs::path> job_around(const fs::path& output) {
  std::error_code error;
  for (fs::path folder = output; folder.has_relative_path(); folder = folder.parent_path())
    if (fs::exists(folder / "job.json", error) && fs::is_directory(folder / "events", error)) return folder;
  return std::nullopt;
}

bool is_new_in_result(const std::string& name) {
  const std::vector<std::string> of_the_job = {kResult, kDiagnostics, kResultFigures, kReportPage};
  return name.starts_with("result/") && std::ranges::find(of_the_job, name) == of_the_job.end();
}

// The project file of a job; empty when the job does not name one.
std::string project_of(const std::string& job) {
  const std::optional<JobJson> json = JobJson::read(JobStore(job));
  return json ? json->value("project", std::string()) : std::string();
}

}  // namespace

std::vector<std::string> inputs_of(const std::string& source, const std::string& made) {
  std::vector<std::string> inputs;
  std::error_code error;
  try {
    inputs = {fs::is_directory(source, error) ? project_of(source) : source};
    for (const std::string& file : files_named_in(inputs.front(), made)) inputs.push_back(file);
  } catch (const InputError&) {
    // The reader of the source reports the error.
  }
  return inputs;
}

void check_output(const std::string& output, const std::vector<std::string>& inputs, const std::string& own) {
  const fs::path place = place_of(output);
  for (const std::string& input : inputs)
    if (takes_place_of(place, input))
      throw InputError(output + ": is an input of this command or of its job (" + input +
                       "), which would be lost; name another output with -o");
  const std::optional<fs::path> job = job_around(place);
  if (!job) return;
  const std::string name = place.lexically_relative(*job).generic_string();
  if (name == own || is_new_in_result(name)) return;
  throw InputError(output + ": belongs to the job directory '" + job->string() +
                   "', which keeps its own files there; name an output outside of it, or a new one in '" +
                   (*job / "result").string() + "'");
}

}  // namespace megablock
