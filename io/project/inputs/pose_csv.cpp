#include "io/project/inputs/pose_csv.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>
#include <unordered_set>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/text/csv_row.h"
#include "io/text/plausible.h"
#include "io/text/text_lines.h"

namespace megablock {

namespace {

constexpr std::array<const char*, 8> kColumns = {"name", "qw", "qx", "qy", "qz", "x", "y", "z"};
constexpr std::size_t kFirstCoordinate = 5;

class CsvReader {
 public:
  explicit CsvReader(const std::string& path) : path_(path), stream_(open_input(path)) {}

  PoseTable read() {
    std::int64_t lines = 0;
    for (std::string line; read_csv_row(stream_, path_, line, lines, separator_); line_ = lines + 1) {
      if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
      if (line.front() == '#') {
        read_origin(line);
      } else if (columns_.empty()) {
        separator_ = csv_separator(line);
        read_header(csv_fields(line, separator_));
      } else {
        read_row(csv_fields(line, separator_));
      }
    }
    if (table_.names.empty())
      throw InputError(
          path_ +
          ": the file has no poses; expected a header with the columns name,qw,qx,qy,qz,x,y,z and a line per frame");
    return std::move(table_);
  }

 private:
  [[noreturn]] void fail(const std::string& message) const { throw InputError(where() + ": " + message); }
  std::string where() const { return path_ + ":" + std::to_string(line_); }

  void read_origin(const std::string& line) {
    std::istringstream words(line.substr(1));
    std::string key;
    GroundFrame ground;
    if (!(words >> key) || key != "origin:") return;
    if (!(words >> ground.latitude_deg >> ground.longitude_deg >> ground.height_m))
      fail("origin: expected latitude, longitude (degrees) and height (metres)");
    ground.georeferenced = true;
    ground.crs = "EPSG:4979";
    table_.ground = ground;
  }

  void read_header(const std::vector<std::string>& fields) {
    for (const char* column : kColumns) {
      const auto found = std::find(fields.begin(), fields.end(), column);
      if (found == fields.end())
        fail(std::string("column '") + column + "' is missing; expected name,qw,qx,qy,qz,x,y,z");
      columns_.push_back(static_cast<std::size_t>(found - fields.begin()));
    }
    const auto pass = std::find(fields.begin(), fields.end(), "pass");
    if (pass != fields.end()) pass_ = static_cast<std::size_t>(pass - fields.begin());
  }

  void read_pass(const std::vector<std::string>& fields) {
    const std::string field = *pass_ < fields.size() ? fields[*pass_] : "";
    std::int64_t pass = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), pass);
    if (error != std::errc() || end != field.data() + field.size()) fail("pass: '" + field + "' is not a whole number");
    table_.passes.push_back(pass);
  }

  void read_row(const std::vector<std::string>& fields) {
    std::array<double, 8> value{};
    for (std::size_t c = 0; c < kColumns.size(); ++c) {
      if (columns_[c] >= fields.size()) fail(std::string("column '") + kColumns[c] + "' is missing in this line");
      if (c == 0) continue;
      const std::string& text = fields[columns_[c]];
      const std::string field = separator_ == ',' ? text : with_decimal_point(text, Separator::kSemicolon);
      // Exact, and the same in every locale.
      const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value[c]);
      if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(value[c]))
        fail(std::string(kColumns[c]) + ": '" + field + "' is not a number; delete the line if the frame has no pose");
      if (c >= kFirstCoordinate) check_on_earth(value[c], kColumns[c], where());
    }
    const Eigen::Quaterniond rotation = unit_rotation({value[1], value[2], value[3], value[4]}, where());
    const std::string& name = fields[columns_[0]];
    if (!seen_.insert(name).second) fail("frame '" + name + "' appears twice; delete one of its lines");
    table_.names.push_back(name);
    table_.poses.push_back({rotation, {value[5], value[6], value[7]}});
    if (pass_) read_pass(fields);
  }

  std::string path_;
  std::ifstream stream_;
  std::int64_t line_ = 1;  // the first one of the row
  char separator_ = ',';
  std::vector<std::size_t> columns_;  // position of each of kColumns in a line
  std::optional<std::size_t> pass_;   // position of the column 'pass'
  std::unordered_set<std::string> seen_;
  PoseTable table_;
};

}  // namespace

PoseTable pose_table(const Block& block, const BlockState& state) {
  PoseTable table;
  if (block.ground.georeferenced) table.ground = block.ground;
  for (std::size_t f = 0; f < block.frames.size(); ++f) {
    const FrameIndex frame(static_cast<std::int64_t>(f));
    if (!state.oriented[frame]) continue;
    table.names.push_back(block.frames[frame].name);
    table.poses.push_back(state.frames[frame]);
    table.passes.push_back(block.frames[frame].pass);
  }
  return table;
}

void write_pose_csv(const std::string& path, const PoseTable& table) {
  std::ofstream stream(path);
  // 17 significant digits give every double back.
  stream.precision(17);
  if (table.ground)
    stream << "# origin: " << table.ground->latitude_deg << ' ' << table.ground->longitude_deg << ' '
           << table.ground->height_m << '\n';
  stream << "name,qw,qx,qy,qz,x,y,z" << (table.passes.empty() ? "\n" : ",pass\n");
  for (std::size_t f = 0; f < table.names.size(); ++f) {
    const Eigen::Quaterniond& q = table.poses[f].rotation;
    const Eigen::Vector3d& c = table.poses[f].centre;
    stream << csv_field(table.names[f]) << ',' << q.w() << ',' << q.x() << ',' << q.y() << ',' << q.z() << ',' << c.x()
           << ',' << c.y() << ',' << c.z();
    if (!table.passes.empty()) stream << ',' << table.passes[f];
    stream << '\n';
  }
  stream.close();
  if (!stream) throw_file_error(path, "written", errno);
}

PoseTable read_pose_csv(const std::string& path) { return CsvReader(path).read(); }

}  // namespace megablock
