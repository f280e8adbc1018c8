#include "cluster/terminal/wrong_usage.h"

#include <algorithm>
#include <cctype>
#include <vector>

#include "io/text/settings_reader.h"

namespace megablock {

namespace {

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

// " min frames " of "--min-frames", "min_frames".
std::string as_words(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return !std::isalnum(c); }, ' ');
  return " " + text + " ";
}

}  // namespace

bool is_unknown_command(const CLI::App& app, const std::string& name) {
  const std::vector<std::string> known = command_names(app);
  return !name.starts_with("-") && std::find(known.begin(), known.end(), name) == known.end();
}

std::string unknown_command_message(const CLI::App& app, const std::string& name) {
  const std::string nearest = nearest_name(name, command_names(app));
  return "megablock: unknown command '" + name + "'; " +
         (nearest.empty() ? "see 'megablock --help'" : "did you mean '" + nearest + "'?");
}

std::string usage_message(const CLI::App& command, const std::string& name, const CLI::Error& error) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options([](const CLI::Option* o) { return o->nonpositional(); }))
    for (const std::string& word : option->get_lnames()) known.push_back("--" + word);
  for (const std::string& argument : command.remaining()) {
    if (!argument.starts_with("-")) continue;
    const std::string option = argument.substr(0, argument.find('='));
    const std::string nearest = option.starts_with("--") ? nearest_name(option, known) : "";
    return "megablock: argument '" + option + "' was not expected; " +
           (nearest.empty() ? "" : "did you mean '" + nearest + "'? ") + "see '" + name + " --help'\n";
  }
  return "megablock: " + std::string(error.what()) + "; see '" + name + " --help'\n";
}

std::string with_given_value(const CLI::App& app, const std::string& message) {
  const std::size_t end = message.find(" must ");
  if (end == std::string::npos) return message;
  const std::string subject = as_words(message.substr(0, end));
  std::string given;
  std::size_t longest = 0;
  for (const CLI::App* command : app.get_subcommands())
    for (const CLI::Option* option : command->get_options([](const CLI::Option* o) { return o->nonpositional(); }))
      for (const std::string& name : option->get_lnames()) {
        const bool wanted = option->count() > 0 && option->get_type_size() > 0 && name.size() > longest;
        if (!wanted || subject.find(as_words(name)) == std::string::npos) continue;
        given = "--" + name + " " + option->results().back() + ": ";
        longest = name.size();
      }
  return given + message;
}

}  // namespace megablock
