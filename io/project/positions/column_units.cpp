#include "io/project/positions/column_units.h"

#include <numbers>

#include "io/text/text_lines.h"

namespace megablock {

namespace {

using Kind = ColumnUnit::Kind;

constexpr double kUsFoot = 1200.0 / 3937;
constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

struct KnownUnit {
  const char* name;  // lower case, letters only
  Kind kind;
  double factor;
  const char* text;
};

constexpr KnownUnit kUnits[] = {{"m", Kind::kLength, 1, "m"},
                                {"meter", Kind::kLength, 1, "m"},
                                {"metre", Kind::kLength, 1, "m"},
                                {"meters", Kind::kLength, 1, "m"},
                                {"metres", Kind::kLength, 1, "m"},
                                {"km", Kind::kLength, 1000, "km"},
                                {"cm", Kind::kLength, 0.01, "cm"},
                                {"mm", Kind::kLength, 0.001, "mm"},
                                {"ft", Kind::kLength, 0.3048, "ft"},
                                {"foot", Kind::kLength, 0.3048, "ft"},
                                {"feet", Kind::kLength, 0.3048, "ft"},
                                {"usft", Kind::kLength, kUsFoot, "us-ft"},
                                {"ftus", Kind::kLength, kUsFoot, "us-ft"},
                                {"usfoot", Kind::kLength, kUsFoot, "us-ft"},
                                {"usfeet", Kind::kLength, kUsFoot, "us-ft"},
                                {"ussurveyft", Kind::kLength, kUsFoot, "us-ft"},
                                {"ussurveyfoot", Kind::kLength, kUsFoot, "us-ft"},
                                {"ussurveyfeet", Kind::kLength, kUsFoot, "us-ft"},
                                {"deg", Kind::kAngle, 1, "deg"},
                                {"degree", Kind::kAngle, 1, "deg"},
                                {"degrees", Kind::kAngle, 1, "deg"},
                                {"rad", Kind::kAngle, kDegreesPerRadian, "rad"},
                                {"radian", Kind::kAngle, kDegreesPerRadian, "rad"},
                                {"radians", Kind::kAngle, kDegreesPerRadian, "rad"},
                                {"mrad", Kind::kAngle, kDegreesPerRadian / 1000, "mrad"},
                                {"gon", Kind::kAngle, 0.9, "gon"},
                                {"arcmin", Kind::kAngle, 1.0 / 60, "arcmin"},
                                {"arcsec", Kind::kAngle, 1.0 / 3600, "arcsec"}};

// The unit of a text in lower case; of kind kUnstated if it is none.
ColumnUnit unit_of(const std::string& text) {
  std::string letters;
  for (const char c : text) {
    if (c >= '0' && c <= '9') return {};
    if (c >= 'a' && c <= 'z') letters += c;
  }
  for (const KnownUnit& unit : kUnits)
    if (letters == unit.name) return {unit.kind, unit.factor, unit.text};
  return {};
}

// Takes a unit off the end of the name: "sigma_mm", "height_us_ft".
void take_ending(ColumnName& column) {
  const std::size_t last = column.name.rfind('_');
  if (last == std::string::npos || last == 0) return;
  for (const std::size_t at : {column.name.rfind('_', last - 1), last}) {
    if (at == std::string::npos || at == 0) continue;
    const ColumnUnit unit = unit_of(column.name.substr(at + 1));
    if (unit.kind == Kind::kUnstated) continue;
    column.name.resize(at);
    if (column.unit.kind == Kind::kUnstated) column.unit = unit;
    return;
  }
}

}  // namespace

ColumnName column_name(const std::string& header) {
  ColumnName column;
  std::string bracket;
  int depth = 0;
  for (const char c : lower_case(header)) {
    const bool word = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (c == '(' || c == '[') {
      ++depth;
    } else if ((c == ')' || c == ']') && depth > 0) {
      if (--depth > 0) continue;
      if (column.unit.kind == Kind::kUnstated) column.unit = unit_of(bracket);
      bracket.clear();
    } else if (depth > 0) {
      bracket += c;
    } else if (word) {
      column.name += c;
    } else if (!column.name.empty() && column.name.back() != '_') {
      column.name += '_';
    }
  }
  while (!column.name.empty() && column.name.back() == '_') column.name.pop_back();
  take_ending(column);
  return column;
}

}  // namespace megablock
