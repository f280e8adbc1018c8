// Numbers and times of files of positions. Internal to io/.
#pragma once

#include <string>

#include "io/project/positions/position_table.h"
#include "io/text/text_lines.h"

namespace megablock {

// A number of a field, with a decimal comma where the separator allows it. Throws InputError.
double position_number(const std::string& text, Separator separator, const std::string& what, const std::string& where);

// A latitude or longitude: decimal degrees, or degrees, minutes and seconds with marks or blanks, with a sign or a
// letter (N, S, E, W) at either end: 46.8426, "46 50' 33.39\" N", "91 deg 59' 40.42\" W". Throws InputError.
double position_degrees(const std::string& text, Separator separator, const std::string& what,
                        const std::string& where);

// A sigma in metres; NaN if the field is empty or 0, as programs write what they do not know. Throws InputError.
double position_sigma_m(const std::string& text, Separator separator, const std::string& what,
                        const std::string& where);

// The same in degrees.
double position_sigma_deg(const std::string& text, Separator separator, const std::string& what,
                          const std::string& where);

// Whether a field is a sigma of 0.
bool is_zero(const std::string& text, Separator separator);

// Reads a horizontal and a vertical sigma from two fields that follow each other, by position_sigma_m().
void read_sigmas(const std::vector<std::string>& fields, std::size_t first, Separator separator,
                 const std::string& where, PositionTable::Row& row);

// Seconds since 1970-01-01 of a date and time of day, without leap seconds. NaN for a date that does not exist.
double calendar_seconds(int year, int month, int day, double seconds_of_day);

// GPS time of a week and its seconds, in seconds since 1970-01-01.
double gps_week_seconds(double week, double seconds);

// GPS time minus UTC, at a time of either scale: the leap seconds since 1980 (IERS, Bulletin C).
double leap_seconds(double time_s);

}  // namespace megablock
