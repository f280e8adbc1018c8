#include "io/project/inputs/frame_measurements_file.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "io/base/error.h"
#include "io/project/inputs/frames_by_name.h"
#include "io/text/csv_table.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

double number_within(const CsvTable& csv, std::size_t row, const std::string& column, const Limits& limits) {
  const double value = csv.needed_number(row, column);
  check_within(value, limits, column, csv.where(row), "; correct the number or its unit");
  return value;
}

void check_sigma_share(const FrameMeasurement& measured, const FrameMeasurementType& type, const std::string& where) {
  const Limits& shares = type.sigma_shares;
  const double size = std::abs(measured.value);
  if (measured.sigma < shares.least * size || measured.sigma > shares.most * size)
    throw InputError(fmt::format(
        "{}: {} must lie in [{:g}, {:g}] times {}, not {:g} with {:g}; correct the numbers or "
        "their units",
        where, type.sigma_column, shares.least, shares.most, type.value_column, measured.sigma, measured.value));
}

// The places of the pairs of frames, in either order: one number for each.
class KnownPairs {
 public:
  explicit KnownPairs(const std::vector<FrameMeasurement>& of_block) {
    for (const FrameMeasurement& measured : of_block) places_.emplace(pair_of(measured), "the block's own file");
  }
  void add(const FrameMeasurement& measured, const std::string& where) {
    const auto [known, fresh] = places_.emplace(pair_of(measured), where);
    if (!fresh)
      throw InputError(where + ": the two frames are measured in " + known->second +
                       " already; keep one line of them, or write their mean");
  }

 private:
  static std::pair<FrameIndex, FrameIndex> pair_of(const FrameMeasurement& measured) {
    return std::minmax(measured.from, measured.to);
  }
  std::map<std::pair<FrameIndex, FrameIndex>, std::string> places_;
};

}  // namespace

void read_frame_measurements(const FrameMeasurementType& type, const std::string& path,
                             const std::vector<std::string>& left_out, Block& block,
                             std::vector<std::string>& warnings) {
  const CsvTable csv(path);
  const std::vector<std::string> columns{"from", "to", type.value_column, type.sigma_column};
  csv.require(columns);
  csv.refuse_others(columns);
  const std::map<std::string, FrameIndex> frames = frames_by_name(block);
  const auto of_block = block.frame_measurements.find(type.key);
  KnownPairs pairs(of_block == block.frame_measurements.end() ? std::vector<FrameMeasurement>() : of_block->second);
  for (std::size_t row = 0; row < csv.row_count(); ++row) {
    FrameMeasurement measured;
    measured.value = number_within(csv, row, type.value_column, type.values);
    measured.sigma = number_within(csv, row, type.sigma_column, type.sigmas);
    check_sigma_share(measured, type, csv.where(row));
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
    pairs.add(measured, csv.where(row));
    block.frame_measurements[type.key].push_back(measured);
  }
}

}  // namespace megablock
