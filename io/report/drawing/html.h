// Formats text, numbers and tables for the HTML of the report.
// Internal to io/: it is not installed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace megablock::report {

std::string escape(std::string_view text);  // for HTML text and attribute values

inline constexpr const char* kMissing = "–";  // printed for a value that is not a finite number

std::string count(std::int64_t value);                  // 27 503, grouped by narrow spaces
std::string fixed(double value, int decimals);          // kMissing if not finite
std::string significant(double value, int digits = 3);  // plain decimals, or with a power of ten if extreme
std::string sigma_text(double value);                   // a standard deviation, with at most three significant digits
std::string with_sign(double value, int decimals);      // +0.012, −0.003
std::string percent(double part, double whole);         // 99.4 %; never rounded up to 100 %
std::string duration(double seconds);                   // 0.4 s, 12 s, 3 min 05 s, 2 h 10 min
std::string memory(double mebibytes);                   // 412 MiB, 2.1 GiB

// The unit of length in which values up to `largest` metres are easy to read.
struct LengthUnit {
  double factor;     // value in this unit = value in metres * factor
  const char* name;  // mm, m; units: of an arbitrary scale
  int decimals;
};
LengthUnit length_unit(double largest_m);
// The same for the unit of a map (ground_unit in sections.h), which may be of an arbitrary scale.
LengthUnit length_unit(double largest, const std::string& of_map);

std::string in_unit(const std::string& name, const LengthUnit& unit);  // "ΔE [mm]"
double largest(const std::vector<Eigen::Vector3d>& values);            // largest finite |component|; 0 if none
// Adds one cell per component.
void axes_cells(const Eigen::Vector3d& v, const LengthUnit& unit, bool sign, std::vector<std::string>& cells);
void sigma_cells(const Eigen::Vector3d& sigmas, const LengthUnit& unit, std::vector<std::string>& cells);

// A table with headings. The first column is text and the others are numbers, unless the constructor is told otherwise.
class Table {
 public:
  explicit Table(std::vector<std::string> headings, std::size_t text_columns = 1);
  void add(std::vector<std::string> cells, const std::string& row_class = "");  // cells are HTML
  bool empty() const { return rows_ == 0; }
  std::string html(const std::string& table_class = "") const;

 private:
  std::string cell(const char* tag, const std::string& text, std::size_t column) const;
  std::vector<std::string> headings_;
  std::size_t text_columns_, rows_ = 0;
  std::string body_;
};

// A note below a list that shows only `listed` of its `all` rows; empty if it shows all.
std::string more(std::size_t all, std::size_t listed);

// A part of the page that is folded until the reader opens it.
std::string details(const std::string& summary, const std::string& body, bool open = false);

// A part of the page with a title.
std::string section(const std::string& id, const std::string& title, const std::string& body);
std::string figure(const std::string& drawing, const std::string& caption);
std::string paragraph(const std::string& text, const std::string& style = "");

}  // namespace megablock::report
