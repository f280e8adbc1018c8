// DJI's log of exposures, ..._Timestamp.MRK: one line for each image of a flight, in the order of exposure.
//
//     1  373434.034125  [2047]  -8,N  -3,E  193,V  45.12345678,Lat  7.12345678,Lon  283.394,Ellh  0.010, 0.009, 0.021
//     50,Q
//
// In this order: number, GPS seconds of week, GPS week; the camera minus the antenna to the north and east and
// DOWNWARD, millimetres; latitude, longitude (degrees, WGS84 or the datum of the base) and height above the ellipsoid
// (metres) of the camera, with these offsets already applied; standard deviations to the north, east and upward,
// metres; kind of solution (50 fixed, 32 to 49 float, 16 single, 0 none). Values are found by their labels.
//
// Sources: DJI, Matrice 4 Series User Manual ("Image Log File"); DJI, P4R White Paper V2 (signs of the offsets).
#include <cmath>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

// Commas and brackets separate like blanks: "[2047]", "-8,N", "0.010, 0.009, 0.021".
std::vector<std::string> mrk_words(std::string line) {
  for (char& c : line)
    if (c == ',' || c == '[' || c == ']' || c == '\t') c = ' ';
  return split_fields(line, Separator::kBlanks);
}

// The word before a label. Throws InputError if there is none.
const std::string& value_before(const std::vector<std::string>& words, const char* label, const std::string& where) {
  for (std::size_t w = 1; w < words.size(); ++w)
    if (words[w] == label) return words[w - 1];
  throw InputError(where + ": has no value '" + label +
                   "'; expected a line of DJI: number, seconds, [week], N, E, V, Lat, Lon, Ellh, sigmas, Q");
}

bool is_mrk(const PositionText& text) {
  const std::string& line = text.lines[0].text;
  return line.find(",Lat") != std::string::npos && line.find(",Ellh") != std::string::npos;
}

PositionTable::Row mrk_row(const std::string& line, const std::string& where) {
  const std::vector<std::string> words = mrk_words(line);
  const auto value = [&](const char* label) {
    return position_number(value_before(words, label, where), Separator::kBlanks, label, where);
  };
  PositionTable::Row row;
  row.where = where;
  row.place = {value("Lon"), value("Lat"), value("Ellh")};
  row.offset_m = Eigen::Vector3d(value("E"), value("N"), -value("V")) / 1000;
  const auto number = [&](std::size_t word, const char* what) {
    if (word >= words.size()) throw InputError(where + ": has no " + what + "; copy the file again");
    return position_number(words[word], Separator::kBlanks, what, where);
  };
  row.number = static_cast<std::int64_t>(number(0, "number"));
  row.time_s = gps_week_seconds(number(2, "week"), number(1, "seconds of week"));
  // The three sigmas stand behind the height.
  for (std::size_t w = 0; w < words.size(); ++w) {
    if (words[w] != "Ellh" || w + 3 >= words.size() || !is_number(words[w + 3])) continue;
    const double north = position_sigma_m(words[w + 1], Separator::kBlanks, "sigma to the north", where);
    const double east = position_sigma_m(words[w + 2], Separator::kBlanks, "sigma to the east", where);
    row.sigma_horizontal_m = std::fmax(north, east);
    row.sigma_vertical_m = position_sigma_m(words[w + 3], Separator::kBlanks, "sigma upward", where);
  }
  return row;
}

PositionTable read_mrk(const PositionText& text, const PositionOptions&) {
  PositionTable table;
  table.kind = PositionTable::Kind::kExposures;
  for (const TextLine& line : text.lines) table.rows.push_back(mrk_row(line.text, text.where(line)));
  return table;
}

}  // namespace

const PositionFormat kDjiMrk = {"mrk", "exposures of DJI (_Timestamp.MRK)", is_mrk, read_mrk};

}  // namespace megablock
