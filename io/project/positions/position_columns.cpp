#include "io/project/positions/position_columns.h"

#include <algorithm>
#include <cmath>

#include "io/project/positions/position_fields.h"

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
       {"height", "ellipsoidal_height", "ellh", "altitude", "alt", "gps_altitude", "gpsaltitude", "elevation", "h"}},
      {"x", {"x", "east", "easting", "x_longitude", "x_east", "x_easting", "geo_x", "e"}},
      {"y", {"y", "north", "northing", "y_latitude", "y_north", "y_northing", "geo_y", "n"}},
      {"z", {"z", "z_altitude", "z_height", "geo_z", "up", "u"}},
      {"sigma_horizontal",
       {"sigma_horizontal", "accuracy_horz", "accuracy_horizontal", "horizontal_accuracy", "accuracy_x_y",
        "accuracy_xy", "xy_accuracy", "gpsxyaccuracy", "horz_accuracy", "sigmahoriz", "horizontal_sigma",
        "rms_horizontal", "h_acc", "accuracy_horiz"}},
      {"sigma_x",
       {"sigma_x", "accuracy_x", "x_accuracy", "accuracyx", "sd_e", "sde", "rtkstdlon", "std_east", "sigma_east"}},
      {"sigma_y",
       {"sigma_y", "accuracy_y", "y_accuracy", "accuracyy", "sd_n", "sdn", "rtkstdlat", "std_north", "sigma_north"}},
      {"sigma_vertical",
       {"sigma_vertical", "accuracy_vert", "accuracy_vertical", "vertical_accuracy", "accuracy_z", "z_accuracy",
        "accuracyz", "gpszaccuracy", "vert_accuracy", "sigmavert", "vertical_sigma", "sd_u", "sdu", "rtkstdhgt",
        "std_up", "sigma_z", "v_acc"}},
      {"sigma", {"sigma", "accuracy", "accuracy_xyz"}},
      {"yaw", {"yaw", "heading", "azimuth"}},
      {"pitch", {"pitch"}},
      {"roll", {"roll"}},
      {"gimbal_yaw", {"gimbal_yaw", "gimbalyawdegree", "gimbalyaw", "camera_yaw"}},
      {"gimbal_pitch", {"gimbal_pitch", "gimbalpitchdegree", "gimbalpitch", "camera_pitch"}},
      {"gimbal_roll", {"gimbal_roll", "gimbalrolldegree", "gimbalroll", "camera_roll"}},
      {"omega", {"omega"}},
      {"phi", {"phi"}},
      {"kappa", {"kappa"}}};
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

std::optional<PositionTable::Row> PositionColumns::row(const std::vector<std::string>& fields, Separator separator,
                                                       const std::string& where, std::optional<AngleKind> other) const {
  const auto text = [&](const char* field) {
    const auto found = place_.find(field);
    return found == place_.end() || found->second >= fields.size() ? std::string() : fields[found->second];
  };
  const auto sigma = [&](const char* field) { return position_sigma_m(text(field), separator, field, where); };
  PositionTable::Row row;
  row.where = where;
  row.image = text("image");
  const bool degrees = geodetic();
  const std::string first = text(degrees ? "longitude" : "x"), second = text(degrees ? "latitude" : "y");
  if (row.image.empty() || first.empty() || second.empty()) return std::nullopt;
  if (degrees)
    row.place.head<2>() = Eigen::Vector2d(position_degrees(first, separator, "longitude", where),
                                          position_degrees(second, separator, "latitude", where));
  else
    row.place.head<2>() =
        Eigen::Vector2d(position_number(first, separator, "x", where), position_number(second, separator, "y", where));
  const std::string height = has("height") ? text("height") : text("z");
  if (!height.empty() && lower_case(height) != "nan")
    row.place.z() = position_number(height, separator, "height", where);
  const double all = sigma("sigma");
  row.sigma_horizontal_m = std::fmax(sigma("sigma_x"), sigma("sigma_y"));
  if (const double stated = sigma("sigma_horizontal"); !std::isnan(stated)) row.sigma_horizontal_m = stated;
  if (std::isnan(row.sigma_horizontal_m)) row.sigma_horizontal_m = all;
  row.sigma_vertical_m = sigma("sigma_vertical");
  if (std::isnan(row.sigma_vertical_m)) row.sigma_vertical_m = all;
  for (const AngleFields& angles : kAngleFields) {
    if (text(angles.first).empty() || text(angles.second).empty() || text(angles.third).empty()) continue;
    row.angles_deg = {position_number(text(angles.first), separator, angles.first, where),
                      position_number(text(angles.second), separator, angles.second, where),
                      position_number(text(angles.third), separator, angles.third, where)};
    row.angles = angles.kind == AngleKind::kBody ? other.value_or(angles.kind) : angles.kind;
    break;
  }
  return row;
}

}  // namespace megablock
