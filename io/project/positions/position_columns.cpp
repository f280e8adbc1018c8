#include "io/project/positions/position_columns.h"

#include <algorithm>
#include <cmath>

#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/row_pose.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"

namespace megablock {

namespace {

struct Synonyms {
  const char* field;
  std::vector<const char*> names;
};

// The first name of a field that a header has counts.
const std::vector<Synonyms>& synonyms() {
  static const std::vector<Synonyms> all = {
      {"image",
       {"image", "name", "label", "filename", "file", "file_name", "imagename", "image_name", "photo", "photo_name",
        "photoname", "sourcefile", "camera", "img", "image_file", "basename"}},
      {"latitude", {"latitude", "lat", "gps_latitude", "gpslatitude", "wgs84_latitude"}},
      {"longitude", {"longitude", "lon", "long", "lng", "gps_longitude", "gpslongitude", "wgs84_longitude"}},
      {"height",
       {"height", "ellipsoidal_height", "ellh", "h_ell", "altitude", "alt", "gps_altitude", "gpsaltitude", "elevation",
        "h"}},
      {"x", {"x", "east", "easting", "x_longitude", "x_east", "x_easting", "geo_x", "e"}},
      {"y", {"y", "north", "northing", "y_latitude", "y_north", "y_northing", "geo_y", "n"}},
      {"z", {"z", "z_altitude", "z_height", "geo_z", "up", "u"}},
      {"sigma_horizontal",
       {"sigma_horizontal", "accuracy_horz", "accuracy_horizontal", "horizontal_accuracy", "accuracy_x_y",
        "accuracy_xy", "xy_accuracy", "gpsxyaccuracy", "horz_accuracy", "sigmahoriz", "horizontal_sigma",
        "rms_horizontal", "h_acc", "accuracy_horiz"}},
      {"sigma_x",
       {"sigma_x", "accuracy_x", "x_accuracy", "accuracyx", "sd_e", "sde", "rtkstdlon", "std_east", "sigma_east",
        "sdeast", "sd_east", "e_sd"}},
      {"sigma_y",
       {"sigma_y", "accuracy_y", "y_accuracy", "accuracyy", "sd_n", "sdn", "rtkstdlat", "std_north", "sigma_north",
        "sdnorth", "sd_north", "n_sd"}},
      {"sigma_vertical",
       {"sigma_vertical",
        "accuracy_vert",
        "accuracy_vertical",
        "vertical_accuracy",
        "accuracy_z",
        "z_accuracy",
        "accuracyz",
        "gpszaccuracy",
        "vert_accuracy",
        "sigmavert",
        "vertical_sigma",
        "sd_u",
        "sdu",
        "rtkstdhgt",
        "std_up",
        "sigma_z",
        "v_acc",
        "sdheight",
        "sd_height",
        "sd_up",
        "sdup",
        "u_sd"}},
      {"sigma", {"sigma", "accuracy", "accuracy_xyz"}},
      {"yaw", {"yaw", "heading", "azimuth"}},
      {"pitch", {"pitch"}},
      {"roll", {"roll"}},
      {"gimbal_yaw", {"gimbal_yaw", "gimbalyawdegree", "gimbalyaw", "camera_yaw"}},
      {"gimbal_pitch", {"gimbal_pitch", "gimbalpitchdegree", "gimbalpitch", "camera_pitch"}},
      {"gimbal_roll", {"gimbal_roll", "gimbalrolldegree", "gimbalroll", "camera_roll"}},
      {"omega", {"omega"}},
      {"phi", {"phi"}},
      {"kappa", {"kappa"}},
      {"qw", {"qw", "q_w"}},
      {"qx", {"qx", "q_x"}},
      {"qy", {"qy", "q_y"}},
      {"qz", {"qz", "q_z"}},
      {"sigma_rotation", {"sigma_rotation"}},
      {"sigma_roll", {"sigma_roll", "rollsd", "sd_roll", "std_roll", "roll_sd"}},
      {"sigma_pitch", {"sigma_pitch", "pitchsd", "sd_pitch", "std_pitch", "pitch_sd"}},
      {"sigma_heading",
       {"sigma_heading", "sigma_yaw", "hdngsd", "headingsd", "sd_heading", "std_heading", "std_yaw", "heading_sd"}},
      {"time",
       {"time_s", "time", "gpstime", "gps_time", "gps_seconds", "gpsseconds", "timestamp", "seconds_of_week", "sow",
        "tow", "gps_sow", "gps_tow"}},
      {"week", {"week", "gpsweek", "gps_week"}},
      {"pass", {"pass", "drive"}}};
  return all;
}

constexpr const char* kLengths[] = {"height", "z", "sigma_horizontal", "sigma_x", "sigma_y", "sigma_vertical", "sigma"};
constexpr const char* kAngles[] = {"latitude",   "longitude",      "yaw",         "pitch",       "roll",
                                   "gimbal_yaw", "gimbal_pitch",   "gimbal_roll", "omega",       "phi",
                                   "kappa",      "sigma_rotation", "sigma_roll",  "sigma_pitch", "sigma_heading"};

bool is_one_of(const auto& fields, const std::string& field) {
  return std::ranges::any_of(fields, [&](const char* name) { return field == name; });
}

// Whether values of a field may have a unit. Names that state metres or degrees are never refused.
bool fits(const std::string& field, const ColumnUnit& unit) {
  if (unit.factor == 1 || field == "x" || field == "y") return true;
  return unit.kind == ColumnUnit::Kind::kLength ? is_one_of(kLengths, field) : is_one_of(kAngles, field);
}

struct AngleFields {
  const char *first, *second, *third;
  AngleKind kind;
};
constexpr AngleFields kAngleFields[] = {{"omega", "phi", "kappa", AngleKind::kOmegaPhiKappa},
                                        {"gimbal_yaw", "gimbal_pitch", "gimbal_roll", AngleKind::kGimbal},
                                        {"yaw", "pitch", "roll", AngleKind::kBody}};

}  // namespace

PositionColumns::PositionColumns(const std::vector<std::string>& header) {
  std::vector<ColumnName> names;
  for (const std::string& name : header) names.push_back(column_name(name));
  // Where two columns state a value in two units, metres and degrees count before others.
  const auto find = [&](const std::string& field, const std::string& name) {
    std::optional<std::size_t> found;
    for (std::size_t c = 0; c < names.size(); ++c) {
      if (names[c].name != name || !fits(field, names[c].unit)) continue;
      if (names[c].unit.factor == 1) return std::optional(c);
      if (!found) found = c;
    }
    return found;
  };
  for (const Synonyms& field : synonyms())
    for (const char* name : field.names) {
      const auto found = find(field.field, name);
      if (!found) continue;
      set(field.field, *found, header[*found]);
      break;
    }
}

void PositionColumns::set(const std::string& field, std::size_t column, const std::string& header) {
  const ColumnUnit unit = column_name(header).unit;
  place_[field] = {column, fits(field, unit) ? unit : ColumnUnit(), header};
}

void PositionColumns::fit_to_system(const std::string& crs, const std::string& path, const std::string& where,
                                    std::vector<PositionTable::Row>& rows) const {
  const auto height = place_.find(height_field());
  const bool other_height = height != place_.end() && height->second.unit.factor != 1;
  const Column* other = nullptr;  // the first of x and y in another unit
  for (const char* field : {"y", "x"})
    if (!geodetic() && has(field) && place_.at(field).unit.factor != 1) other = &place_.at(field);
  if (rows.empty() || (!other && !other_height)) return;
  const SystemOfTable system(crs, path);
  const Eigen::Vector2d unit_m = system.metres_per_unit(rows[0].place);
  const auto same = [](double a, double b, double share) { return std::abs(a / b - 1) < share; };
  // A grid is up to a few per cent longer or shorter than the ground.
  constexpr double kScale = 0.1, kHeightScale = 0.01;
  if (other && !(other->unit.kind == ColumnUnit::Kind::kLength && same(unit_m.x(), other->unit.factor, kScale)))
    throw InputError(where + ": column '" + other->header + "' is in " + other->unit.text +
                     ", and the coordinate reference system '" + crs +
                     "' is not; name a system in this unit with 'crs', or convert the coordinates to metres");
  if (other_height && same(unit_m.y(), height->second.unit.factor, kHeightScale))
    for (PositionTable::Row& row : rows) row.place.z() /= height->second.unit.factor;
}

bool PositionColumns::has_sigmas() const { return has("sigma") || has("sigma_x") || has("sigma_horizontal"); }

bool PositionColumns::has_angle_sigmas() const { return has("sigma_rotation") || has("sigma_roll"); }

bool PositionColumns::geodetic() const { return has("latitude") && has("longitude"); }

bool PositionColumns::has_place() const { return geodetic() || (has("x") && has("y")); }

bool PositionColumns::is_field(const std::string& name) {
  return std::ranges::any_of(synonyms(), [&](const Synonyms& field) { return name == field.field; });
}

std::string PositionColumns::fields() {
  std::string list;
  for (const Synonyms& field : synonyms()) list += (list.empty() ? "" : ", ") + std::string(field.field);
  return list;
}

// The texts of a line by field.
struct PositionColumns::Texts {
  const std::map<std::string, Column>& place;
  const std::vector<std::string>& fields;
  Separator separator;
  const std::string& where;

  std::string text(const char* field) const {
    const auto found = place.find(field);
    return found == place.end() || found->second.at >= fields.size() ? std::string() : fields[found->second.at];
  }
  double factor(const char* field) const {
    const auto found = place.find(field);
    return found == place.end() ? 1 : found->second.unit.factor;
  }
  bool given(std::initializer_list<const char*> names) const {
    return std::ranges::none_of(names, [&](const char* name) { return text(name).empty(); });
  }
  double coordinate(const char* field) const { return position_number(text(field), separator, field, where); }
  double degrees(const char* field) const {
    return factor(field) * position_degrees(text(field), separator, field, where);
  }
  double number(const char* field) const { return factor(field) * coordinate(field); }
  double sigma_m(const char* field) const {
    return factor(field) * position_sigma_m(text(field), separator, field, where);
  }
  double sigma_deg(const char* field) const {
    return factor(field) * position_sigma_deg(text(field), separator, field, where);
  }
};

void PositionColumns::set_sigmas(const Texts& of, PositionTable::Row& row) {
  const double all = of.sigma_m("sigma");
  row.sigma_horizontal_m = std::fmax(of.sigma_m("sigma_x"), of.sigma_m("sigma_y"));
  if (const double stated = of.sigma_m("sigma_horizontal"); !std::isnan(stated)) row.sigma_horizontal_m = stated;
  if (std::isnan(row.sigma_horizontal_m)) row.sigma_horizontal_m = all;
  row.sigma_vertical_m = of.sigma_m("sigma_vertical");
  if (std::isnan(row.sigma_vertical_m)) row.sigma_vertical_m = all;
  for (const char* field : {"sigma", "sigma_x", "sigma_y", "sigma_horizontal", "sigma_vertical"})
    row.zero_sigma = row.zero_sigma || is_zero(of.text(field), of.separator);
  const double rotation = of.sigma_deg("sigma_rotation");
  row.sigma_tilt_deg = std::fmax(of.sigma_deg("sigma_roll"), of.sigma_deg("sigma_pitch"));
  if (std::isnan(row.sigma_tilt_deg)) row.sigma_tilt_deg = rotation;
  row.sigma_heading_deg = of.sigma_deg("sigma_heading");
  if (std::isnan(row.sigma_heading_deg)) row.sigma_heading_deg = rotation;
}

void PositionColumns::set_attitude(const Texts& of, std::optional<AngleKind> other, PositionTable::Row& row) {
  if (of.given({"qw", "qx", "qy", "qz"})) {
    row.rotation = unit_rotation({of.number("qw"), of.number("qx"), of.number("qy"), of.number("qz")}, of.where);
    row.angles = AngleKind::kRotation;
    return;
  }
  for (const AngleFields& angles : kAngleFields) {
    if (!of.given({angles.first, angles.second, angles.third})) continue;
    row.angles_deg = {of.number(angles.first), of.number(angles.second), of.number(angles.third)};
    row.angles = angles.kind == AngleKind::kBody ? other.value_or(angles.kind) : angles.kind;
    return;
  }
}

void PositionColumns::set_time(const Texts& of, PositionTable::Row& row) {
  const auto seconds = [&](const char* field) {
    return parse_number(with_decimal_point(of.text(field), of.separator), field, of.where);
  };
  if (!of.text("time").empty()) row.time_s = seconds("time");
  if (!of.text("week").empty() && !std::isnan(row.time_s)) row.time_s = gps_week_seconds(seconds("week"), row.time_s);
  if (!of.text("pass").empty()) row.pass = parse_integer(of.text("pass"), "pass", of.where);
}

std::optional<PositionTable::Row> PositionColumns::row(const std::vector<std::string>& fields, Separator separator,
                                                       const std::string& where, std::optional<AngleKind> other) const {
  const Texts of{place_, fields, separator, where};
  PositionTable::Row row;
  row.where = where;
  row.image = of.text("image");
  const bool degrees = geodetic();
  const std::string first = of.text(degrees ? "longitude" : "x"), second = of.text(degrees ? "latitude" : "y");
  if ((row.image.empty() && of.text("time").empty()) || first.empty() || second.empty()) return std::nullopt;
  if (degrees)
    row.place.head<2>() = Eigen::Vector2d(of.degrees("longitude"), of.degrees("latitude"));
  else
    row.place.head<2>() = Eigen::Vector2d(of.coordinate("x"), of.coordinate("y"));
  const std::string height = of.text(height_field());
  if (!height.empty() && lower_case(height) != "nan")
    row.place.z() = of.factor(height_field()) * position_number(height, separator, "height", where);
  set_time(of, row);
  set_sigmas(of, row);
  set_attitude(of, other, row);
  return row;
}

}  // namespace megablock
