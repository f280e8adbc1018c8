// Applies one section of the project file (StageSettings) to the fields of an option struct, with messages that name
// file and line. Where the options live is where their keys are known:
//
//     SettingsReader reader(project.settings, "adjustment");
//     reader.number("max_residual_sigmas", options.max_residual_sigmas);
//     reader.integer("max_iterations", options.max_iterations);
//     reader.finish();   // unknown keys are refused here
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/text/stage_settings.h"

namespace megablock {

class SettingsReader {
 public:
  SettingsReader(const StageSettings& settings, std::string section);

  // Each declares a key and, when the project file has it, sets the field and returns true. InputError "file:line: ..."
  // when the value is not of the kind: a unit after a number is refused (units are in the names of the keys).
  bool number(const std::string& key, double& field);
  bool integer(const std::string& key, int& field);
  bool integer(const std::string& key, std::int64_t& field);
  bool flag(const std::string& key, bool& field);  // true | false
  bool text(const std::string& key, std::string& field);
  // One of `choices`; the field becomes its position.
  bool choice(const std::string& key, const std::vector<std::string>& choices, int& field);

  // InputError naming the first key of the section that was never declared, and the keys there are.
  void finish() const;

 private:
  const StageSettings::Entry* find(const std::string& key);

  const StageSettings& settings_;
  std::string section_;
  std::vector<std::string> known_;
};

// The sections that go to the stages, in the order of the pipeline.
const std::vector<std::string>& stage_sections();

// Parsers of one scalar, shared with the rest of the project file; `what` is the key, `where` file:line.
double parse_number(const std::string& text, const std::string& what, const std::string& where);
std::int64_t parse_integer(const std::string& text, const std::string& what, const std::string& where);
bool parse_flag(const std::string& text, const std::string& what, const std::string& where);

// The known name nearest to a misspelled one; empty when none is near.
std::string nearest_name(const std::string& name, const std::vector<std::string>& known);
// "unknown key 'x' in 'section'; did you mean 'y'? known keys: ..." with the nearest known key when there is one.
std::string unknown_key_message(const std::string& key, const std::string& section,
                                const std::vector<std::string>& known);

}  // namespace megablock
