#include "io/report/drawing/html.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace megablock::report {

namespace {

constexpr const char* kNarrowSpace = "\u202f";
constexpr const char* kMinus = "\u2212";

std::string grouped(std::string digits) {
  for (auto i = static_cast<std::ptrdiff_t>(digits.size()) - 3; i > 0; i -= 3)
    digits.insert(static_cast<std::size_t>(i), kNarrowSpace);
  return digits;
}

// Prints a number with the typographic minus sign. A value that rounds to zero has no sign.
std::string signed_text(double value, int decimals, bool plus) {
  const std::string digits = fmt::format("{:.{}f}", std::abs(value), decimals);
  if (digits.find_first_not_of("0.") == std::string::npos) return digits;
  return (value < 0 ? kMinus : plus ? "+" : "") + digits;
}

// The style of a cell with text: short texts stay on one line, notes break between words, long names may break
// anywhere.
const char* text_class(const std::string& text) {
  constexpr std::size_t kShort = 28, kLongWord = 40;
  if (text.size() <= kShort) return " class=t";
  std::size_t word = 0, longest = 0;
  for (char c : text) longest = std::max(longest, word = c == ' ' || c == '<' || c == '>' ? 0 : word + 1);
  return longest > kLongWord ? " class=\"t long\"" : " class=\"t note\"";
}

}  // namespace

std::string escape(std::string_view text) {
  std::string result;
  for (char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '\'':
        result += "&#39;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string count(std::int64_t value) {
  return (value < 0 ? kMinus : "") + grouped(std::to_string(value < 0 ? -value : value));
}

std::string fixed(double value, int decimals) {
  return std::isfinite(value) ? signed_text(value, decimals, false) : kMissing;
}

std::string with_sign(double value, int decimals) {
  return std::isfinite(value) ? signed_text(value, decimals, true) : kMissing;
}

std::string significant(double value, int digits) {
  if (!std::isfinite(value)) return kMissing;
  if (value == 0) return "0";
  const int power = static_cast<int>(std::floor(std::log10(std::abs(value))));
  if (power < -4 || power > 8) {
    const std::string mantissa = signed_text(value / std::pow(10, power), std::max(0, digits - 1), false);
    return fmt::format("{}\u00b710<sup>{}{}</sup>", mantissa, power < 0 ? kMinus : "", std::abs(power));
  }
  // A number of magnitude 10^power has power + 1 digits before the point.
  return signed_text(value, std::max(0, digits - 1 - power), false);
}

std::string percent(double part, double whole) {
  if (!(whole > 0) || !std::isfinite(part)) return kMissing;
  const double share = 100 * part / whole;
  // A rounded 100 % would say that nothing is missing.
  if (part < whole && share > 99.9) return "99.9\u202f%";
  return fmt::format("{:.{}f}\u202f%", share, share == 0 || share == 100 ? 0 : 1);
}

std::string duration(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0) return kMissing;
  if (seconds < 10) return fmt::format("{:.1f}\u202fs", seconds);
  const auto whole = std::llround(seconds);
  if (whole < 60) return fmt::format("{}\u202fs", whole);
  if (whole < 3600) return fmt::format("{}\u202fmin {:02d}\u202fs", whole / 60, whole % 60);
  return fmt::format("{}\u202fh {:02d}\u202fmin", whole / 3600, whole % 3600 / 60);
}

std::string memory(double mebibytes) {
  if (!std::isfinite(mebibytes) || mebibytes <= 0) return kMissing;
  if (mebibytes >= 1024) return fmt::format("{:.1f}\u202fGiB", mebibytes / 1024);
  return fmt::format("{:.0f}\u202fMiB", mebibytes);
}

LengthUnit length_unit(double largest_m) {
  if (!(largest_m >= 0.02)) return {1000, "mm", 2};
  if (largest_m < 1) return {1000, "mm", 0};
  return {1, "m", largest_m < 10 ? 3 : 2};
}

LengthUnit length_unit(double largest, const std::string& of_map) {
  return of_map == "m" ? length_unit(largest) : LengthUnit{1, "units", 5};
}

std::string in_unit(const std::string& name, const LengthUnit& unit) { return name + " [" + unit.name + "]"; }

double largest(const std::vector<Eigen::Vector3d>& values) {
  double result = 0;
  for (const Eigen::Vector3d& v : values)
    for (double c : v)
      if (std::isfinite(c)) result = std::max(result, std::abs(c));
  return result;
}

void axes_cells(const Eigen::Vector3d& v, const LengthUnit& unit, bool sign, std::vector<std::string>& cells) {
  for (double c : v)
    cells.push_back(sign ? with_sign(c * unit.factor, unit.decimals) : fixed(c * unit.factor, unit.decimals));
}

std::string sigma_text(double value) { return significant(value, value > 0 && value < 1 ? 2 : 3); }

void sigma_cells(const Eigen::Vector3d& sigmas, const LengthUnit& unit, std::vector<std::string>& cells) {
  for (double s : sigmas) cells.push_back(sigma_text(s * unit.factor));
}

Table::Table(std::vector<std::string> headings, std::size_t text_columns)
    : headings_(std::move(headings)), text_columns_(text_columns) {}

std::string Table::cell(const char* tag, const std::string& text, std::size_t column) const {
  return fmt::format("<{0}{1}>{2}</{0}>", tag, column < text_columns_ ? text_class(text) : "", text);
}

void Table::add(std::vector<std::string> cells, const std::string& row_class) {
  ++rows_;
  body_ += row_class.empty() ? "<tr>" : "<tr class=\"" + row_class + "\">";
  for (std::size_t c = 0; c < cells.size(); ++c) body_ += cell("td", cells[c], c);
  body_ += "</tr>\n";
}

std::string Table::html(const std::string& table_class) const {
  std::string head;
  for (std::size_t c = 0; c < headings_.size(); ++c) head += cell("th", headings_[c], c);
  return "<div class=wide><table class=\"" + table_class + "\"><thead><tr>" + head + "</tr></thead><tbody>\n" + body_ +
         "</tbody></table></div>\n";
}

std::string more(std::size_t all, std::size_t listed) {
  return all > listed ? paragraph("… and " + count(static_cast<std::int64_t>(all - listed)) + " more.", "muted") : "";
}

std::string details(const std::string& summary, const std::string& body, bool open) {
  return std::string("<details") + (open ? " open" : "") + "><summary>" + summary + "</summary>\n" + body +
         "</details>\n";
}

std::string section(const std::string& id, const std::string& title, const std::string& body) {
  return "<section id=\"" + id + "\"><h2>" + title + "</h2>\n" + body + "</section>\n";
}

std::string figure(const std::string& drawing, const std::string& caption) {
  return "<figure>" + drawing + "<figcaption>" + caption + "</figcaption></figure>\n";
}

std::string paragraph(const std::string& text, const std::string& style) {
  return (style.empty() ? "<p>" : "<p class=\"" + style + "\">") + text + "</p>\n";
}

}  // namespace megablock::report
