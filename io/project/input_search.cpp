#include "io/project/input_search.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "io/base/error.h"
#include "io/project/image_scan.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

// All files of the folder and its sub-folders, and those of its parent, in the order of their names.
std::vector<fs::path> files_about(const fs::path& images) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::recursive_directory_iterator item(images, error), end; !error && item != end; item.increment(error)) {
    if (is_leftover(item->path())) {
      if (item->is_directory(error)) item.disable_recursion_pending();
    } else if (!is_image_name(item->path().string()) && item->is_regular_file(error)) {
      files.push_back(item->path());
    }
  }
  std::sort(files.begin(), files.end());
  std::vector<fs::path> above;
  for (const fs::directory_entry& item : fs::directory_iterator(images.parent_path(), error))
    if (item.is_regular_file(error) && !is_leftover(item.path())) above.push_back(item.path());
  std::sort(above.begin(), above.end());
  files.insert(files.end(), above.begin(), above.end());
  return files;
}

std::string ending_of(const fs::path& path) { return lower_case(path.extension().string()); }

// Whether the file has this format. Only the endings that receivers write are opened.
bool has_format(const fs::path& path, const PositionFormat& format) {
  try {
    const PositionText text{path.string(), read_text_lines(path.string())};
    return recognise_positions(text) == &format;
  } catch (const Error&) {
    return false;
  }
}

// What a file named geo.txt is: others than OpenDroneMap use the name for tables with a header.
std::string describe_positions(const fs::path& path) {
  try {
    if (const auto* format = recognise_positions(read_position_text(path.string()))) return format->describe;
  } catch (const Error&) {
    // The reader will say what is wrong with the file.
  }
  return kOdmGeo.describe;
}

std::vector<FoundInput> find_logs(const std::vector<fs::path>& files) {
  struct Logs {
    std::vector<std::string> exposures, solutions;
  };
  std::map<fs::path, Logs> folders;
  for (const fs::path& path : files) {
    if (ending_of(path) == ".mrk" && has_format(path, kDjiMrk))
      folders[path.parent_path()].exposures.push_back(path.string());
    if (ending_of(path) == ".pos" && has_format(path, kRtklibPos))
      folders[path.parent_path()].solutions.push_back(path.string());
  }
  std::vector<FoundInput> inputs;
  for (const auto& [folder, logs] : folders) {
    if (logs.exposures.size() == 1 && logs.solutions.size() == 1) {
      inputs.push_back({"positions", {logs.solutions[0], logs.exposures[0]}, kRtklibPos.describe});
      continue;
    }
    for (const std::string& file : logs.exposures) inputs.push_back({"positions", {file}, kDjiMrk.describe});
    // Events and the path of one receiver lie side by side. The events are the exposures.
    const auto events = std::find_if(logs.solutions.begin(), logs.solutions.end(),
                                     [](const std::string& file) { return lower_case(file).ends_with("_events.pos"); });
    if (logs.exposures.empty() && !logs.solutions.empty())
      inputs.push_back(
          {"positions", {events == logs.solutions.end() ? logs.solutions[0] : *events}, kRtklibPos.describe});
  }
  return inputs;
}

}  // namespace

std::vector<FoundInput> find_inputs(const std::string& images) {
  const std::vector<fs::path> files = files_about(fs::absolute(images + "/").lexically_normal().parent_path());
  std::vector<FoundInput> inputs;
  const auto named = [&](const char* name) {
    return std::find_if(files.begin(), files.end(),
                        [&](const fs::path& path) { return lower_case(path.filename().string()) == name; });
  };
  for (const char* name : {"gcp_list.txt", "ground_control_points.json"}) {
    const auto found = named(name);
    if (found == files.end()) continue;
    inputs.push_back({"control", {found->string()}, "control points"});
    break;
  }
  if (const auto geo = named("geo.txt"); geo != files.end()) {
    inputs.push_back({"positions", {geo->string()}, describe_positions(*geo)});
    return inputs;
  }
  const std::vector<FoundInput> logs = find_logs(files);
  inputs.insert(inputs.end(), logs.begin(), logs.end());
  return inputs;
}

}  // namespace megablock
