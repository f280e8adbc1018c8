#include "io/project/inputs/frame_measurements_file.h"

#include <algorithm>
#include <map>

#include "io/base/error.h"
#include "io/text/csv_table.h"

namespace megablock {

namespace {

std::map<std::string, FrameIndex> frames_by_name(const Block& block) {
  std::map<std::string, FrameIndex> frames;
  for (ImageIndex i(0); block.images.contains(i); ++i.value) frames.emplace(block.name_of(i), block.images[i].frame);
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) frames.emplace(block.frames[f].name, f);
  return frames;
}

double positive_number(const CsvTable& csv, std::size_t row, const std::string& column) {
  const double value = csv.needed_number(row, column);
  if (!(value > 0)) throw InputError(csv.where(row) + ": " + column + " must be positive");
  return value;
}

}  // namespace

void read_frame_measurements(const FrameMeasurementType& type, const std::string& path,
                             const std::vector<std::string>& left_out, Block& block,
                             std::vector<std::string>& warnings) {
  const CsvTable csv(path);
  const std::vector<std::string> columns{"from", "to", type.value_column, type.sigma_column};
  csv.require(columns);
  csv.refuse_others(columns);
  const std::map<std::string, FrameIndex> frames = frames_by_name(block);
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    FrameMeasurement measured;
    measured.value = type.positive ? positive_number(csv, row, type.value_column)
                                   : csv.needed_number(row, type.value_column);
    measured.sigma = positive_number(csv, row, type.sigma_column);
    bool used = true;
    for (const char* end : {"from", "to"}) {
      const std::string name = csv.text(row, end);
      if (std::ranges::find(left_out, name) != left_out.end()) {
        warnings.push_back(csv.where(row) + ": the line is not used, because '" + name + "' was left out of the block");
        used = false;
        continue;
      }
      const auto found = frames.find(name);
      if (found == frames.end())
        throw InputError(csv.where(row) + ": " + end + ": the block has no image and no frame '" + name +
                         "'; correct the name or delete the line");
      (end[0] == 'f' ? measured.from : measured.to) = found->second;
    }
    if (!used) continue;
    if (measured.from == measured.to)
      throw InputError(csv.where(row) + ": 'from' and 'to' belong to the same frame; name two different frames");
    block.frame_measurements[type.key].push_back(measured);
  }
}

}  // namespace megablock
