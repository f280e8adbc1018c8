#include "io/project/positions/position_fields.h"

#include <chrono>
#include <cmath>

#include "io/base/error.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"

namespace megablock {

double position_number(const std::string& text, Separator separator, const std::string& what,
                       const std::string& where) {
  if (text.empty()) throw InputError(where + ": " + what + " is empty");
  const double value = parse_number(with_decimal_point(text, separator), what, where);
  check_on_earth(value, what, where);
  return value;
}

double position_degrees(const std::string& text, Separator separator, const std::string& what,
                        const std::string& where) {
  if (is_number(with_decimal_point(text, separator))) return position_number(text, separator, what, where);
  std::string numbers;
  double sign = 1;
  for (const char c : text) {
    if (c == 'S' || c == 'W') sign = -1;
    const bool part = (c >= '0' && c <= '9') || c == '.';
    numbers += part || c == '-' ? c : ' ';  // marks, letters and "deg" separate
  }
  const std::vector<std::string> parts = split_fields(numbers, Separator::kBlanks);
  double degrees = 0, unit = 1;
  if (parts.empty() || parts.size() > 3)
    throw InputError(where + ": " + what + ": '" + text +
                     "' is no angle in degrees, or in degrees, minutes and seconds");
  for (const std::string& part : parts) {
    const double value = parse_number(part, what, where);
    degrees += (std::signbit(parse_number(parts[0], what, where)) ? -std::abs(value) : value) * unit;
    unit /= 60;
  }
  return sign * degrees;
}

namespace {

double position_sigma(const std::string& text, Separator separator, const Limits& limits, const std::string& what,
                      const std::string& where) {
  if (text.empty() || lower_case(text) == "nan") return kNoNumber;
  const double sigma = position_number(text, separator, what, where);
  if (sigma == 0) return kNoNumber;
  try {
    check_within(sigma, limits, what, where);
  } catch (const InputError& error) {
    throw InputError(std::string(error.what()) +
                     "; write a standard deviation, or leave the field empty if it is not known");
  }
  return sigma;
}

}  // namespace

double position_sigma_m(const std::string& text, Separator separator, const std::string& what,
                        const std::string& where) {
  return position_sigma(text, separator, kSigmaMetres, what, where);
}

double position_sigma_deg(const std::string& text, Separator separator, const std::string& what,
                          const std::string& where) {
  return position_sigma(text, separator, kSigmaDegrees, what, where);
}

bool is_zero(const std::string& text, Separator separator) {
  const std::string number = with_decimal_point(text, separator);
  return is_number(number) && parse_number(number, "", "") == 0;
}

void read_sigmas(const std::vector<std::string>& fields, std::size_t first, Separator separator,
                 const std::string& where, PositionTable::Row& row) {
  row.sigma_horizontal_m = position_sigma_m(fields[first], separator, "horizontal accuracy", where);
  row.sigma_vertical_m = position_sigma_m(fields[first + 1], separator, "vertical accuracy", where);
  row.zero_sigma = is_zero(fields[first], separator) || is_zero(fields[first + 1], separator);
}

double calendar_seconds(int year, int month, int day, double seconds_of_day) {
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return kNoNumber;
  return static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count()) * 86400 + seconds_of_day;
}

double gps_week_seconds(double week, double seconds) {
  return calendar_seconds(1980, 1, 6, 0) + week * 7 * 86400 + seconds;
}

double leap_seconds(double time_s) {
  struct Step {
    int year, month;
  };
  // Each step adds a second at the beginning of its month.
  constexpr Step kSteps[] = {{1981, 7}, {1982, 7}, {1983, 7}, {1985, 7}, {1988, 1}, {1990, 1},
                             {1991, 1}, {1992, 7}, {1993, 7}, {1994, 7}, {1996, 1}, {1997, 7},
                             {1999, 1}, {2006, 1}, {2009, 1}, {2012, 7}, {2015, 7}, {2017, 1}};
  double seconds = 0;
  for (const Step& step : kSteps) seconds += time_s >= calendar_seconds(step.year, step.month, 1, 0);
  return seconds;
}

}  // namespace megablock
