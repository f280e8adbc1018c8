#include "io/project/positions/position_columns.h"

#include <algorithm>
#include <cmath>

#include "io/project/positions/position_fields.h"
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

std::string comparable_name(const std::string& name) {
  std::string result;
  int depth = 0;
  for (const char c : lower_case(name)) {
    if (c == '(' || c == '[') ++depth;
    const bool word = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (depth == 0) {
      if (word)
        result += c;
      else if (!result.empty() && result.back() != '_')
        result += '_';
    }
    if (c == ')' || c == ']') --depth;
  }
  while (!result.empty() && result.back() == '_') result.pop_back();
  for (const std::string ending : {"_m", "_deg", "_meter", "_degrees"})
    if (result.ends_with(ending)) result.resize(result.size() - ending.size());
  return result;
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
  std::vector<std::string> names;
  for (const std::string& name : header) names.push_back(comparable_name(name));
  for (const Synonyms& field : synonyms())
    for (const char* name : field.names) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end()) continue;
      place_.emplace(field.field, static_cast<std::size_t>(found - names.begin()));
      break;
    }
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
  const std::map<std::string, std::size_t>& place;
  const std::vector<std::string>& fields;
  Separator separator;
  const std::string& where;

  std::string text(const char* field) const {
    const auto found = place.find(field);
    return found == place.end() || found->second >= fields.size() ? std::string() : fields[found->second];
  }
  bool given(std::initializer_list<const char*> names) const {
    return std::ranges::none_of(names, [&](const char* name) { return text(name).empty(); });
  }
  double number(const char* field) const { return position_number(text(field), separator, field, where); }
  double sigma_m(const char* field) const { return position_sigma_m(text(field), separator, field, where); }
  double sigma_deg(const char* field) const { return position_sigma_deg(text(field), separator, field, where); }
};

void PositionColumns::set_sigmas(const Texts& of, PositionTable::Row& row) {
  const double all = of.sigma_m("sigma");
  row.sigma_horizontal_m = std::fmax(of.sigma_m("sigma_x"), of.sigma_m("sigma_y"));
  if (const double stated = of.sigma_m("sigma_horizontal"); !std::isnan(stated)) row.sigma_horizontal_m = stated;
  if (std::isnan(row.sigma_horizontal_m)) row.sigma_horizontal_m = all;
  row.sigma_vertical_m = of.sigma_m("sigma_vertical");
  if (std::isnan(row.sigma_vertical_m)) row.sigma_vertical_m = all;
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
    row.place.head<2>() = Eigen::Vector2d(position_degrees(first, separator, "longitude", where),
                                          position_degrees(second, separator, "latitude", where));
  else
    row.place.head<2>() = Eigen::Vector2d(of.number("x"), of.number("y"));
  const std::string height = has("height") ? of.text("height") : of.text("z");
  if (!height.empty() && lower_case(height) != "nan")
    row.place.z() = position_number(height, separator, "height", where);
  set_time(of, row);
  set_sigmas(of, row);
  set_attitude(of, other, row);
  return row;
}

}  // namespace megablock
