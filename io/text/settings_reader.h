// Copies one section of the project file (StageSettings) into the fields of an option struct, with messages that name
// file and line. The keys are declared next to the options that they set:
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

  // Each function declares a key. If the project file has it, the function sets the field and returns true. Throws
  // InputError "file:line: ..." for a value of the wrong kind. A unit after a number is refused, because the names of
  // keys contain it.
  bool number(const std::string& key, double& field);
  bool integer(const std::string& key, int& field);
  bool integer(const std::string& key, std::int64_t& field);
  bool flag(const std::string& key, bool& field);  // true | false
  bool text(const std::string& key, std::string& field);
  // One of `choices`; the field is set to its position.
  bool choice(const std::string& key, const std::vector<std::string>& choices, int& field);

  // Throws InputError for the first key of the section that was not declared, with the list of known keys.
  void finish() const;

 private:
  const StageSettings::Entry* find(const std::string& key);

  const StageSettings& settings_;
  std::string section_;
  std::vector<std::string> known_;
};

// Parsers of single values, shared by all readers of the project file. `what` is the key, `where` is file:line.
double parse_number(const std::string& text, const std::string& what, const std::string& where);
std::int64_t parse_integer(const std::string& text, const std::string& what, const std::string& where);
bool parse_flag(const std::string& text, const std::string& what, const std::string& where);

// The known name most similar to a misspelled one; empty if none is similar.
std::string nearest_name(const std::string& name, const std::vector<std::string>& known);
// "unknown key 'x' in 'section'; did you mean 'y'? known keys: ...", with the most similar known key if there is one.
std::string unknown_key_message(const std::string& key, const std::string& section,
                                const std::vector<std::string>& known);

}  // namespace megablock
