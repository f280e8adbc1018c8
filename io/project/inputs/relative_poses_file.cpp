#include "io/project/inputs/relative_poses_file.h"

#include <algorithm>
#include <map>
#include <utility>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/project/inputs/frames_by_name.h"
#include "io/text/csv_row.h"
#include "io/text/csv_table.h"
#include "io/text/plausible.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace {

double sigma_within(const CsvTable& csv, std::size_t row, const std::string& column, const Limits& limits) {
  const double value = csv.needed_number(row, column);
  check_within(value, limits, column, csv.where(row), "; correct the number or its unit");
  return value;
}

RelativePose relative_pose_of(const CsvTable& csv, std::size_t row) {
  RelativePose relative;
  relative.pose.rotation = unit_rotation({csv.needed_number(row, "qw"), csv.needed_number(row, "qx"),
                                          csv.needed_number(row, "qy"), csv.needed_number(row, "qz")},
                                         csv.where(row));
  relative.pose.centre = {csv.needed_metres(row, "x"), csv.needed_metres(row, "y"), csv.needed_metres(row, "z")};
  relative.position_sigma_m = sigma_within(csv, row, "sigma_position_m", kSigmaMetres);
  relative.rotation_sigma_rad = kDegree * sigma_within(csv, row, "sigma_rotation_deg", kSigmaDegrees);
  return relative;
}

}  // namespace

void read_relative_poses(const std::string& path, const std::vector<std::string>& left_out, Block& block,
                         std::vector<std::string>& warnings) {
  const CsvTable csv(path);
  csv.require({"from", "to", "qw", "qx", "qy", "qz", "x", "y", "z", "sigma_position_m", "sigma_rotation_deg"});
  const std::map<std::string, FrameIndex> frames = frames_by_name(block);
  std::map<std::pair<FrameIndex, FrameIndex>, std::string> known;
  block.relative_poses.clear();
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    RelativePose relative = relative_pose_of(csv, row);
    bool used = true;
    for (const auto& [end, index] : {std::pair("from", &relative.from), std::pair("to", &relative.to)}) {
      const std::string name = csv.text(row, end);
      const auto found = frames.find(name);
      if (found != frames.end()) {
        *index = found->second;
      } else if (std::ranges::find(left_out, name) != left_out.end()) {
        warnings.push_back(csv.where(row) + ": the line is not used, because '" + name + "' was left out of the block");
        used = false;
      } else {
        throw InputError(csv.where(row) + ": " + end + ": the block has no image and no frame '" + name +
                         "'; correct the name or delete the line");
      }
    }
    if (!used) continue;
    if (relative.from == relative.to)
      throw InputError(csv.where(row) + ": 'from' and 'to' belong to the same frame; name two different frames");
    const auto [other, fresh] = known.emplace(std::minmax(relative.from, relative.to), csv.where(row));
    if (!fresh)
      throw InputError(csv.where(row) + ": the two frames have a relative pose in " + other->second +
                       " already; keep one line of them");
    block.relative_poses.push_back(relative);
  }
}

void write_relative_poses(const std::string& path, const Block& block) {
  TextWriter writer(path);
  writer.print("from,to,qw,qx,qy,qz,x,y,z,sigma_position_m,sigma_rotation_deg\n");
  for (const RelativePose& relative : block.relative_poses) {
    const Eigen::Quaterniond& q = relative.pose.rotation;
    const Eigen::Vector3d& t = relative.pose.centre;
    writer.print("{},{},{},{},{},{},{},{},{},{},{:.15g}\n", csv_field(block.frames[relative.from].name),
                 csv_field(block.frames[relative.to].name), q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(),
                 relative.position_sigma_m, relative.rotation_sigma_rad / kDegree);
  }
  writer.close();
}

}  // namespace megablock
