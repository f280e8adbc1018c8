#include "cluster/stages/stages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "cluster/job/stage.h"

namespace megablock {
namespace {

using testing::HasSubstr;

std::string document(const std::string& name) {
  std::ifstream in(MEGABLOCK_SOURCE "/docs/" + name);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The row of the table in docs/developer/architecture.md.
std::string row_of(const Stage& stage) {
  std::string command = stage.command;
  if (stage.command_given != nullptr && command != stage.command_given)
    command = std::string(stage.command_given) + " with given tie points";
  return "\n| " + std::string(stage.name) + " | " + stage.needs + " | `" + stage.makes + "` | " + stage.unit + " | " +
         (command.empty() ? "–" : command) + " |\n";
}

TEST(Stages, StandInTheDocumentsWithTheirFiles) {
  const std::string architecture = document("developer/architecture.md"), files = document("reference/file-formats.md");
  for (const Stage& stage : all_stages()) {
    EXPECT_THAT(architecture, HasSubstr(row_of(stage)));
    EXPECT_THAT(files, HasSubstr("\n  " + std::string(stage.makes) + " ")) << stage.name;
  }
}

// "a, b and c", or with another word before the last.
std::string list_of(const std::vector<std::string>& words, const std::string& before_last) {
  std::string list = words.front();
  for (std::size_t i = 1; i < words.size(); ++i) list += (i + 1 < words.size() ? ", " : before_last) + words[i];
  return list;
}

TEST(Stages, AreListedInTheGuideAndTheirCommandsInTheReference) {
  std::vector<std::string> names, commands;
  for (const Stage& stage : all_stages()) {
    names.emplace_back(stage.name);
    if (stage.help != nullptr) commands.emplace_back(stage.command);
  }
  std::string guide = document("guide/first-block.md");  // its lines may break anywhere in the list
  guide = std::regex_replace(guide, std::regex("\\s+"), " ");
  EXPECT_THAT(guide, HasSubstr("The stages are " + list_of(names, " and ") + "."));
  EXPECT_THAT(document("reference/commands.md"), HasSubstr("\n## " + list_of(commands, ", ") + "\n"));
}

TEST(Stages, ShareNoNameFolderOrSection) {
  std::set<std::string> names, folders, sections;
  for (const Stage& stage : all_stages()) {
    EXPECT_TRUE(names.insert(stage.name).second) << stage.name;
    EXPECT_EQ(find_stage(stage.name), &stage);
  }
  for (const std::string& folder : unit_folders()) EXPECT_TRUE(folders.insert(folder).second) << folder;
  for (const SettingsSection& section : settings_sections())
    EXPECT_TRUE(sections.insert(section.name).second) << section.name;
  EXPECT_EQ(find_stage("places"), nullptr);  // of `register`
}

TEST(Stages, ACommandEndsWithOneStageOfEachKindOfJob) {
  for (const bool given : {false, true})
    for (const Stage& shown : all_stages()) {
      if (shown.help == nullptr) continue;
      const auto ends = [&](const Stage& stage) { return stage.ends(shown.command, given); };
      EXPECT_EQ(std::ranges::count_if(all_stages(), ends), 1) << shown.command << given;
    }
}

TEST(Stages, AFolderForTheirFilesAloneIsPartOfWhatTheyMake) {
  EXPECT_EQ((Stage{.makes = "tracks/<tile>.h5"}.folder()), "tracks");
  EXPECT_TRUE((Stage{.makes = "tracks/<tile>.h5"}.makes_file_by_tile()));
  EXPECT_EQ((Stage{.makes = "orient/<generation>.h5"}.folder()), "orient");
  EXPECT_FALSE((Stage{.makes = "orient/<generation>.h5"}.makes_file_by_tile()));
  for (const char* alone : {"tiles.h5", "result/block.h5"}) EXPECT_EQ(Stage{.makes = alone}.folder(), "");
}

}  // namespace
}  // namespace megablock
