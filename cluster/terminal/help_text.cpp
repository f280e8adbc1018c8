#include "cluster/terminal/help_text.h"

#include "cluster/terminal/terminal_text.h"

namespace megablock {

std::string HelpText::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const {
  const std::string help = CLI::Formatter::make_help(app, std::move(name), mode), footer = make_footer(app);
  const bool footed = mode != CLI::AppFormatMode::Sub && help.ends_with(footer);
  return wrapped(help.substr(0, help.size() - (footed ? footer.size() : 0)), terminal_columns().value_or(80),
                 get_column_width()) +
         (footed ? footer : "");
}

}  // namespace megablock
