// Reads the three formats of control files into a ControlTable.
#include "io/project/inputs/control_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/text/csv_row.h"
#include "io/text/csv_table.h"
#include "io/text/plausible.h"
#include "io/text/settings_reader.h"
#include "io/text/text_lines.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace {

using Json = nlohmann::json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Throws InputError for impossible coordinates. The height may be NaN (unknown).
void check_coordinates(const Eigen::Vector3d& coordinates, const std::string& where) {
  check_on_earth(coordinates.x(), "x", where);
  check_on_earth(coordinates.y(), "y", where);
  if (!std::isnan(coordinates.z())) check_on_earth(coordinates.z(), "z", where);
}

// -- gcp_list.txt --

bool is_unknown_height(const std::string& text) { return lower_case(text) == "nan"; }

struct GcpFields {
  std::vector<std::string> text;
  Separator separator = Separator::kBlanks;
  std::string number(std::size_t field) const { return with_decimal_point(text[field], separator); }
};

constexpr std::size_t kGcpNumbers = 5;  // x y z column row

// Whether the first five fields are numbers, or the height is unknown.
bool is_gcp_row(const GcpFields& fields) {
  if (fields.text.size() <= kGcpNumbers) return false;
  for (std::size_t f = 0; f < kGcpNumbers; ++f)
    if (!is_number(fields.number(f)) && (f != 2 || !is_unknown_height(fields.text[f]))) return false;
  return true;
}

// Splits a line at the separator that leaves five numbers in front, so that "13,4 52,5 40 5 6 a.jpg" has decimal commas
// and "13.4,52.5,40,5,6,a.jpg" has commas between its fields. Tabs come first: names may then contain blanks.
GcpFields gcp_fields(const std::string& line) {
  for (const Separator separator : {Separator::kTab, Separator::kSemicolon, Separator::kComma, Separator::kBlanks}) {
    GcpFields fields{split_fields(line, separator), separator};
    if (is_gcp_row(fields)) return fields;
  }
  return {split_fields(line, separator_of(line)), separator_of(line)};
}

// The line under the system may name the columns.
bool names_gcp_columns(const GcpFields& fields) {
  return fields.text.size() > kGcpNumbers &&
         std::none_of(fields.text.begin(), fields.text.end(), [](const std::string& text) { return is_number(text); });
}

// The name of the system without quotes, and without the separators that spreadsheets write after it.
std::string gcp_system(std::string line) {
  while (!line.empty() && std::string(" \t,;").find(line.back()) != std::string::npos) line.pop_back();
  if (line.size() > 1 && line.front() == '"' && line.back() == '"') line = line.substr(1, line.size() - 2);
  return line;
}

ControlTable read_gcp_list(const std::string& path) {
  ControlTable table;
  table.pixels = ControlTable::Pixels::kCentresAtInteger;
  table.crs.clear();
  std::map<std::string, std::size_t> point_of_key;
  bool first_row = true;
  for (const TextLine& line : read_text_lines(path)) {
    const std::string where = path + ":" + std::to_string(line.number);
    if (line.text.front() == '#') continue;
    if (table.crs.empty()) {
      table.crs = gcp_system(line.text);
      table.crs_where = where;
      continue;
    }
    const GcpFields fields = gcp_fields(line.text);
    if (std::exchange(first_row, false) && names_gcp_columns(fields)) continue;
    if (fields.text.size() <= kGcpNumbers)
      throw InputError(where + ": " + std::to_string(fields.text.size()) +
                       " fields in this line; expected x y z column row image [name]");
    // Without a name, the text of the coordinates identifies the point: programs repeat it in each line.
    const bool has_name = fields.text.size() > 6 && !fields.text[6].empty();
    const std::string key = has_name ? fields.text[6] : fields.text[0] + " " + fields.text[1] + " " + fields.text[2];
    const auto number = [&](std::size_t field, const char* what) {
      return parse_number(fields.number(field), what, where);
    };
    const Eigen::Vector3d coordinates(number(0, "x"), number(1, "y"),
                                      is_unknown_height(fields.text[2]) ? kNaN : number(2, "z"));
    check_coordinates(coordinates, where);
    const auto [found, inserted] = point_of_key.emplace(key, table.points.size());
    if (inserted) {
      ControlTable::Point point;
      point.name = has_name ? key : "gcp" + std::to_string(table.points.size() + 1);
      point.coordinates = coordinates;
      point.where = where;
      table.points.push_back(point);
    }
    ControlTable::Point& point = table.points[found->second];
    const bool same_height =
        coordinates.z() == point.coordinates.z() || (std::isnan(coordinates.z()) && std::isnan(point.coordinates.z()));
    if (coordinates.head<2>() != point.coordinates.head<2>() || !same_height)
      throw InputError(where + ": point '" + point.name + "' has other coordinates than in " + point.where +
                       "; correct one of the lines, or give the points different names");
    point.measurements.push_back({fields.text[5], {number(3, "column"), number(4, "row")}, 0.5, where});
  }
  if (table.crs.empty())
    throw InputError(path +
                     ": the file is empty; its first line must name the coordinate reference system (EPSG:25832, for "
                     "example)");
  return table;
}

// -- ground_control_points.json --

// Finds the line of a value for messages. The JSON parser does not keep the lines of its values, so this class searches
// the text for the values, point after point.
class JsonLines {
 public:
  JsonLines(const std::string& text, const std::string& path) : text_(text), path_(path) {}

  // Returns file:line of the next `value` in quotes after the current position. If `advance` is set, this place becomes
  // the current position.
  std::string find(const std::string& value, bool advance) {
    const std::size_t at = text_.find("\"" + value + "\"", at_);
    const std::size_t place = at == std::string::npos ? at_ : at;
    if (advance) at_ = place;
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(place);
    return path_ + ":" + std::to_string(1 + std::count(text_.begin(), end, '\n'));
  }

 private:
  const std::string& text_;
  std::string path_;
  std::size_t at_ = 0;
};

double json_number(const Json& object, const char* key, const std::string& where) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number())
    throw InputError(where + ": '" + std::string(key) + "' is missing or not a number; write it as a number");
  return found->get<double>();
}

ControlTable::Point json_point(const Json& entry, JsonLines& lines) {
  ControlTable::Point point;
  if (!entry.is_object() || !entry.contains("id"))
    throw InputError(lines.find("points", false) + ": a point has no 'id'; give every point one");
  point.name = entry["id"].is_string() ? entry["id"].get<std::string>() : entry["id"].dump();
  point.where = lines.find(point.name, true);
  const std::string role = entry.contains("role") ? entry["role"].dump() : "";
  if (role == "\"metrics_only\"" || role == "1") point.role = PointRole::kCheck;
  if (entry.contains("position")) {
    const Json& position = entry["position"];
    point.coordinates = {json_number(position, "longitude", point.where),
                         json_number(position, "latitude", point.where),
                         position.contains("altitude") ? json_number(position, "altitude", point.where) : kNaN};
    check_coordinates(point.coordinates, point.where);
  } else {
    point.coordinates.setConstant(kNaN);
  }
  if (!entry.contains("observations")) return point;
  for (const Json& o : entry["observations"]) {
    if (!o.is_object() || !o.contains("shot_id") || !o["shot_id"].is_string() || !o.contains("projection") ||
        !o["projection"].is_array() || o["projection"].size() != 2 || !o["projection"][0].is_number() ||
        !o["projection"][1].is_number())
      throw InputError(point.where + ": an observation of point '" + point.name +
                       "' needs shot_id and projection: [x, y]");
    const std::string image = o["shot_id"].get<std::string>();
    point.measurements.push_back(
        {image, {o["projection"][0].get<double>(), o["projection"][1].get<double>()}, 0.5, lines.find(image, false)});
  }
  return point;
}

ControlTable read_json(const std::string& text, const std::string& path) {
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::parse_error& error) {
    const auto begin = text.begin();
    const auto at = begin + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size()));
    throw InputError(path + ":" + std::to_string(1 + std::count(begin, at, '\n')) +
                     ": not valid JSON: " + error.what());
  }
  if (!json.is_object() || !json.contains("points") || !json["points"].is_array())
    throw InputError(path + ":1: expected an object with a list 'points'");
  ControlTable table;
  table.crs = "WGS84";
  table.crs_where = path;
  table.pixels = ControlTable::Pixels::kNormalised;
  JsonLines lines(text, path);
  for (const Json& entry : json["points"]) {
    ControlTable::Point point = json_point(entry, lines);
    if (std::isnan(point.coordinates.x()))
      table.warnings.push_back(point.where + ": point '" + point.name + "' is left out, because it has no 'position'");
    else
      table.points.push_back(std::move(point));
  }
  return table;
}

// -- CSV --

PointRole role_of(const std::string& text, const std::string& where) {
  if (text.empty() || text == "control") return PointRole::kControl;
  if (text == "check") return PointRole::kCheck;
  throw InputError(where + ": role: '" + text + "' is not one of: control, check");
}

// Reads the first line of a point, which gives its coordinates. Later lines may repeat them or leave them empty.
ControlTable::Point csv_point(const CsvTable& csv, std::size_t row) {
  ControlTable::Point point;
  point.name = csv.text(row, "name");
  point.where = csv.where(row);
  point.role = role_of(csv.text(row, "role"), point.where);
  point.coordinates = {csv.needed_number(row, "x"), csv.needed_number(row, "y"), csv.number(row, "z").value_or(kNaN)};
  check_coordinates(point.coordinates, point.where);
  if (const auto sigma = csv.number(row, "sigma_horizontal_m", kSigmaMetres)) point.sigma.head<2>().setConstant(*sigma);
  if (const auto sigma = csv.number(row, "sigma_vertical_m", kSigmaMetres)) point.sigma.z() = *sigma;
  return point;
}

void check_repeated(const CsvTable& csv, std::size_t row, const ControlTable::Point& point) {
  const char* const columns[] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) {
    const auto value = csv.number(row, columns[a]);
    if (value && *value != point.coordinates[a])
      throw InputError(csv.where(row) + ": point '" + point.name + "' has another " + columns[a] + " than in " +
                       point.where + "; correct one of the lines, or give the points different names");
  }
}

ControlTable read_csv(const std::string& path) {
  const CsvTable csv(path);
  const bool marks = csv.has("image") && csv.has("column_px") && csv.has("row_px");
  csv.require({"name", "x", "y", "z", "image", "column_px", "row_px"},
              marks ? "" : "each point needs its marks in images, one line for each: image, column_px, row_px");
  csv.refuse_others({"name", "x", "y", "z", "image", "column_px", "row_px", "role", "sigma_horizontal_m",
                     "sigma_vertical_m", "sigma_px"});
  ControlTable table;
  if (!csv.comment("crs").empty()) table.crs = csv.comment("crs");
  table.crs_where = path;
  std::map<std::string, std::size_t> point_of_name;
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    const std::string name = csv.text(row, "name"), where = csv.where(row);
    if (name.empty()) throw InputError(where + ": name is empty; give every point a name");
    const auto [found, inserted] = point_of_name.emplace(name, table.points.size());
    if (inserted) table.points.push_back(csv_point(csv, row));
    ControlTable::Point& point = table.points[found->second];
    if (!inserted) check_repeated(csv, row, point);
    if (csv.text(row, "image").empty()) continue;  // this line has no image measurement
    point.measurements.push_back({csv.text(row, "image"),
                                  {csv.needed_number(row, "column_px"), csv.needed_number(row, "row_px")},
                                  csv.number(row, "sigma_px", kSigmaPx).value_or(0.5),
                                  where});
  }
  return table;
}

// Whether a file has the first line of gcp_list.txt: the name of a system alone, not the names of columns.
bool begins_with_system(const std::string& path) {
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.front() == '#') continue;
    const std::string head = gcp_system(line.text);
    return split_fields(head, separator_of(head)).size() == 1;
  }
  return false;
}

ControlTable read_format(const std::string& path) {
  const std::string extension = lower_case(std::filesystem::path(path).extension().string());
  if (extension == ".csv" && !begins_with_system(path)) return read_csv(path);
  if (extension != ".json") return read_gcp_list(path);
  const std::ifstream stream = open_input(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return read_json(text.str(), path);
}

}  // namespace

ControlTable read_control_table(const std::string& path) {
  ControlTable table = read_format(path);
  table.path = path;
  return table;
}

void write_control_csv(const std::string& path, const Block& block) {
  TextWriter writer(path);
  writer.print("# crs: local\nname,role,x,y,z,sigma_horizontal_m,sigma_vertical_m,image,column_px,row_px,sigma_px\n");
  for (const ControlPoint& point : block.control_points) {
    const Eigen::Vector3d& p = point.position;
    const std::string head = fmt::format(
        "{},{},{},{},{},{},{}", csv_field(point.name), point.role == PointRole::kCheck ? "check" : "control", p.x(),
        p.y(), std::isnan(p.z()) ? "" : fmt::format("{}", p.z()), point.sigma.x(), point.sigma.z());
    for (const ImageMeasurement& m : point.measurements)
      writer.print("{},{},{},{},{}\n", head, csv_field(block.name_of(m.image)), m.pixel.x(), m.pixel.y(), m.sigma_px);
    if (point.measurements.empty()) writer.print("{},,,,\n", head);
  }
  writer.close();
}

}  // namespace megablock
