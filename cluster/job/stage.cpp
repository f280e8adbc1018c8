#include "cluster/job/stage.h"

#include <algorithm>
#include <filesystem>

namespace megablock {

std::string Stage::folder() const {
  const std::string file = makes;
  const std::size_t end = file.find("/<");
  return end == std::string::npos ? "" : file.substr(0, end);
}

std::string Stage::ending() const { return std::filesystem::path(makes).extension(); }

bool Stage::makes_file_by_tile() const { return std::string(makes).find("/<tile>.") != std::string::npos; }

const Stage* find_stage(const std::string& name) {
  const auto found = std::ranges::find_if(all_stages(), [&](const Stage& stage) { return stage.name == name; });
  return found == all_stages().end() ? nullptr : &*found;
}

std::vector<Stage> stages_of_job(bool given_tie_points) {
  std::vector<Stage> stages;
  std::ranges::copy_if(all_stages(), std::back_inserter(stages),
                       [&](const Stage& stage) { return stage.runs(given_tie_points); });
  return stages;
}

std::vector<std::string> unit_folders() {
  std::vector<std::string> folders;
  for (const Stage& stage : all_stages())
    if (!stage.folder().empty()) folders.push_back(stage.folder());
  return folders;
}

std::vector<const OptionSection*> option_sections() {
  std::vector<const OptionSection*> sections;
  for (const Stage& stage : all_stages())
    for (const OptionSection* section : stage.sections)
      if (section != nullptr) sections.push_back(section);
  return sections;
}

std::vector<SettingsSection> settings_sections() {
  std::vector<SettingsSection> sections;
  for (const Stage& stage : all_stages())
    for (const OptionSection* section : stage.sections)
      if (section != nullptr)
        sections.push_back({section->name, section->file_key == nullptr ? "" : section->file_key, !stage.runs(true)});
  return sections;
}

}  // namespace megablock
