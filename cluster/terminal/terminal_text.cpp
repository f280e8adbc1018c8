#include "cluster/terminal/terminal_text.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace megablock {

namespace {

bool breaks_at(const std::string& line, std::size_t at) { return line[at] == ' ' || line[at - 1] == ','; }

// The last place to break at or before `columns`, else the first one after it; never before `least`.
std::size_t place_to_break(const std::string& line, std::size_t least, std::size_t columns) {
  for (std::size_t at = columns; at > least; --at)
    if (breaks_at(line, at)) return at;
  for (std::size_t at = columns + 1; at < line.size(); ++at)
    if (breaks_at(line, at)) return at;
  return line.size();
}

std::string wrapped_line(std::string line, std::size_t columns, std::size_t indent) {
  std::string text;
  while (line.size() > columns) {
    const std::size_t end = place_to_break(line, indent, columns);
    const std::size_t next = line.find_first_not_of(' ', end);
    if (next == std::string::npos) return text + line.substr(0, end);
    text += line.substr(0, line.find_last_not_of(' ', end - 1) + 1) + "\n";
    line = std::string(indent, ' ') + line.substr(next);
  }
  return text + line;
}

}  // namespace

std::optional<std::size_t> terminal_columns() {
  constexpr long kNarrowest = 40;
  const char* variable = std::getenv("COLUMNS");
  long columns = variable ? std::strtol(variable, nullptr, 10) : 0;
  winsize size{};
  if (columns <= 0 && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0) columns = size.ws_col;
  if (columns <= 0) return std::nullopt;
  return static_cast<std::size_t>(std::max(columns, kNarrowest));
}

std::string wrapped(const std::string& text, std::size_t columns, std::size_t description, std::size_t hanging) {
  std::istringstream lines(text);
  std::string result;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t start = std::min(line.size(), line.find_first_not_of(' '));
    const bool option = start > 0 && start < description && line.size() > description && line[description - 1] == ' ' &&
                        line[description] != ' ';
    result += wrapped_line(line, columns, std::min(option ? description : start + hanging, columns / 2)) + "\n";
  }
  return result;
}

std::string for_terminal(const std::string& text) {
  const auto columns = ::isatty(STDOUT_FILENO) ? terminal_columns() : std::nullopt;
  return columns ? wrapped(text, *columns, 0, 2) : text;
}

}  // namespace megablock
