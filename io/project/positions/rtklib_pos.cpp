// Solutions of RTKLIB and Emlid Studio: .pos with an epoch of the antenna's path in each line, and _events.pos with an
// exposure in each line. Lines that begin with % are the header; the last of them names the columns:
//
//     % (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)
//     %  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m) ...
//     2019/06/19 08:00:00.000   48.117266300   11.516700000   545.1234   1  12   0.0051   0.0043   0.0098 ...
//
// Time: GPST, UTC or JST (UTC + 9 h) as the first column says, as a date and time of day or as GPS week and seconds.
// Place: latitude, longitude (degrees, or degrees, minutes and seconds) and height, or x, y, z of the earth-centred
// frame. Heights are above the ellipsoid; with "WGS84/geodetic" above RTKLIB's geoid, EGM96. Sigmas are metres, for x,
// y, z along these axes; the largest then counts for all. Baselines (e/n/u) have no place on earth and are refused.
//
// Sources: T. Takasu, RTKLIB 2.4.2 Manual, appendix B.1; its function outsolhead (solution.c); Emlid Studio writes the
// same for events.
#include <cmath>
#include <cstdio>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"

namespace megablock {

namespace {

// Sigmas of solutions without their own, by Q from 1: fix, float, SBAS, DGPS, single, PPP; metres.
constexpr double kSigmaOfQuality[] = {0.03, 0.5, 1.5, 1, 3, 0.3};

struct PosHeader {
  std::string columns;  // the line that names them
  bool degrees = false, dms = false, earth_centred = false, geoid = false;
};

PosHeader pos_header(const PositionText& text) {
  PosHeader header;
  for (const TextLine& line : text.lines) {
    if (line.text.front() != '%') break;
    const std::string lower = lower_case(line.text);
    if (lower.find("/geodetic") != std::string::npos) header.geoid = true;
    if (lower.find("latitude(") != std::string::npos || lower.find("x-ecef(") != std::string::npos ||
        lower.find("e-baseline(") != std::string::npos)
      header.columns = line.text;
  }
  const std::string lower = lower_case(header.columns);
  header.degrees = lower.find("latitude(deg)") != std::string::npos;
  header.dms = lower.find("latitude(d'") != std::string::npos;
  header.earth_centred = lower.find("x-ecef(") != std::string::npos;
  return header;
}

bool is_pos(const PositionText& text) { return text.lines[0].text.front() == '%' && !pos_header(text).columns.empty(); }

// The time in the scale of GPS, from the first two fields.
double pos_time(const std::string& first, const std::string& second, const std::string& scale,
                const std::string& where) {
  int year, month, day, hour, minute;
  double seconds;
  double time = kNoNumber;
  if (is_number(first) && is_number(second)) {
    time = gps_week_seconds(position_number(first, Separator::kBlanks, "GPS week", where),
                            position_number(second, Separator::kBlanks, "seconds of week", where));
  } else if (std::sscanf(first.c_str(), "%d/%d/%d", &year, &month, &day) == 3 &&
             std::sscanf(second.c_str(), "%d:%d:%lf", &hour, &minute, &seconds) == 3) {
    time = calendar_seconds(year, month, day, hour * 3600 + minute * 60 + seconds);
  }
  if (std::isnan(time))
    throw InputError(where + ": '" + first + " " + second +
                     "' is no time; expected a date and time (2019/06/19 08:00:00.000) or GPS week and seconds");
  if (scale.find("UTC") != std::string::npos) return time + leap_seconds(time);
  if (scale.find("JST") != std::string::npos) return time - 9 * 3600 + leap_seconds(time);
  return time;
}

Separator pos_separator(const std::string& line) {
  const Separator separator = separator_of(line);
  return separator == Separator::kTab ? Separator::kBlanks : separator;
}

class PosReader {
 public:
  PosReader(const PositionText& text, const PosHeader& header) : text_(text), header_(header) {}

  PositionTable read() {
    table_.kind = PositionTable::Kind::kPath;
    const std::string path = lower_case(text_.path);
    if (path.find("_events.pos") != std::string::npos) table_.kind = PositionTable::Kind::kExposures;
    table_.crs = header_.earth_centred ? "EPSG:4978" : header_.geoid ? "EPSG:4326+5773" : "WGS84";
    for (const TextLine& line : text_.lines)
      if (line.text.front() != '%') read_row(line);
    return std::move(table_);
  }

 private:
  void read_row(const TextLine& line) {
    const std::string where = text_.where(line);
    const Separator separator = pos_separator(line.text);
    const std::vector<std::string> fields = split_fields(line.text, separator);
    const std::size_t place = 2, after = place + (header_.dms ? 7 : 3);  // two fields of time stand first
    if (fields.size() < after + 1)
      throw InputError(where + ": " + std::to_string(fields.size()) +
                       " fields in this line; expected time, position, Q and sigmas as the header names them");
    const auto number = [&](std::size_t field, const char* what) {
      return position_number(fields[field], separator, what, where);
    };
    PositionTable::Row row;
    row.where = where;
    row.time_s = pos_time(fields[0], fields[1], header_.columns, where);
    const auto dms = [&](std::size_t field) {
      return position_degrees(fields[field] + " " + fields[field + 1] + " " + fields[field + 2], Separator::kBlanks,
                              "angle", where);
    };
    if (header_.earth_centred)
      row.place = {number(place, "x"), number(place + 1, "y"), number(place + 2, "z")};
    else if (header_.dms)
      row.place = {dms(place + 3), dms(place), number(place + 6, "height")};
    else
      row.place = {number(place + 1, "longitude"), number(place, "latitude"), number(place + 2, "height")};
    set_sigmas(fields, separator, after, where, row);
    table_.rows.push_back(row);
  }

  void set_sigmas(const std::vector<std::string>& fields, Separator separator, std::size_t quality,
                  const std::string& where, PositionTable::Row& row) const {
    const double q = position_number(fields[quality], separator, "Q", where);
    const auto sigma = [&](std::size_t field) {
      return quality + 2 + field < fields.size()
                 ? position_sigma_m(fields[quality + 2 + field], separator, "sigma", where)
                 : kNoNumber;
    };
    row.sigma_horizontal_m = std::fmax(sigma(0), sigma(1));
    row.sigma_vertical_m = sigma(2);
    if (header_.earth_centred)
      row.sigma_horizontal_m = row.sigma_vertical_m = std::fmax(row.sigma_horizontal_m, row.sigma_vertical_m);
    if (!(q >= 1 && q <= static_cast<double>(std::size(kSigmaOfQuality)))) return;
    const double of_quality = kSigmaOfQuality[static_cast<std::size_t>(q) - 1];
    if (std::isnan(row.sigma_horizontal_m)) row.sigma_horizontal_m = of_quality;
    if (std::isnan(row.sigma_vertical_m)) row.sigma_vertical_m = 2 * of_quality;
  }

  const PositionText& text_;
  PosHeader header_;
  PositionTable table_;
};

PositionTable read_pos(const PositionText& text, const PositionOptions&) {
  const PosHeader header = pos_header(text);
  if (!header.degrees && !header.dms && !header.earth_centred)
    throw InputError(text.path +
                     ": the header names no positions (latitude and longitude, or x-ecef); baselines have no place on "
                     "earth: write the solution as latitude, longitude and height");
  return PosReader(text, header).read();
}

}  // namespace

const PositionFormat kRtklibPos = {"rtklib", "solution or events of RTKLIB (.pos)", is_pos, read_pos};

}  // namespace megablock
