// SBET, the smoothed best estimate of trajectory of Applanix POSPac and of other post-processors: a binary file without
// header, of records of 17 doubles (little endian, as on all supported machines):
//
//     time [s of the GPS week, or of the UTC week], latitude, longitude [rad], height [m, above the ellipsoid],
//     3 velocities [m/s], roll, pitch, platform heading, wander angle [rad], 3 accelerations, 3 angular rates
//
// The angles are those of the body (x forward, y right, z down) against north, east and down; the true heading is the
// platform heading minus the wander angle. Sigmas stand in a second file ("smrmsg_...out", `accuracy`) of records of 10
// doubles at the same or fewer times:
//
//     time [s], north, east, down [m], 3 velocities [m/s], roll, pitch, heading [minutes of arc]; all of them rms
//
// Sources: Applanix, POSPac MMS GNSS-Inertial Tools User Guide, appendix on file formats; PDAL, readers.sbet and
// readers.smrmsg, for the order and the units of the fields.
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "geometry/numbers/angles.h"
#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/position_formats.h"
#include "io/text/plausible.h"

namespace megablock {

namespace {

constexpr std::size_t kSbetFields = 17, kAccuracyFields = 10;
using SbetRecord = std::array<double, kSbetFields>;
using AccuracyRecord = std::array<double, kAccuracyFields>;
constexpr double kSameEpoch = 1;  // s, from an epoch of the path to that of its accuracy, which is given each second

template <typename Record>
std::vector<Record> read_records(const std::string& path, const char* what) {
  const std::uintmax_t bytes = std::filesystem::file_size(path);
  if (bytes == 0 || bytes % sizeof(Record) != 0)
    throw InputError(path + ": is no " + what + ": its " + std::to_string(bytes) + " bytes are no multiple of " +
                     std::to_string(sizeof(Record)) + "; give the whole file, or correct 'format'");
  std::ifstream file(path, std::ios::binary);
  std::vector<Record> records(bytes / sizeof(Record));
  if (!file.read(reinterpret_cast<char*>(records.data()), static_cast<std::streamsize>(bytes)))
    throw_file_error(path, "read", errno);
  return records;
}

std::string where_of_record(const std::string& path, std::size_t record) {
  return path + ": record " + std::to_string(record + 1);
}

bool is_place(const SbetRecord& record) {
  return std::isfinite(record[0]) && record[0] >= 0 && std::abs(record[1]) <= std::numbers::pi / 2 &&
         std::abs(record[2]) <= 2 * std::numbers::pi && std::abs(record[3]) < 1e5 &&
         std::abs(record[7]) <= 2 * std::numbers::pi && std::abs(record[8]) <= 2 * std::numbers::pi;
}

bool is_sbet(const PositionText& text) {
  if (!text.binary || std::filesystem::file_size(text.path) % sizeof(SbetRecord) != 0) return false;
  SbetRecord first{};
  std::ifstream file(text.path, std::ios::binary);
  return file.read(reinterpret_cast<char*>(first.data()), sizeof first) && is_place(first);
}

// Sets the sigmas of rows in the order of time from the accuracies at or next to their times.
void set_accuracies(const std::string& path, std::vector<PositionTable::Row>& rows) {
  const auto records = read_records<AccuracyRecord>(path, "file of the accuracy of an SBET");
  std::size_t at = 0, without = 0;
  for (PositionTable::Row& row : rows) {
    const auto distance = [&](std::size_t r) { return std::abs(records[r][0] - row.time_s); };
    while (at + 1 < records.size() && distance(at + 1) <= distance(at)) ++at;
    if (distance(at) > kSameEpoch) {
      ++without;
      continue;
    }
    const AccuracyRecord& record = records[at];
    const auto sigma = [&](std::size_t field, double unit, const Limits& limits) {
      if (!(record[field] > 0)) return kNoNumber;
      check_within(record[field] * unit, limits, "sigma", where_of_record(path, at));
      return record[field] * unit;
    };
    row.sigma_horizontal_m = std::fmax(sigma(1, 1, kSigmaMetres), sigma(2, 1, kSigmaMetres));
    row.sigma_vertical_m = sigma(3, 1, kSigmaMetres);
    row.sigma_tilt_deg = std::fmax(sigma(7, 1.0 / 60, kSigmaDegrees), sigma(8, 1.0 / 60, kSigmaDegrees));
    row.sigma_heading_deg = sigma(9, 1.0 / 60, kSigmaDegrees);
  }
  if (without == rows.size())
    throw InputError(path +
                     ": has no record within a second of those of the trajectory; give the file of the same drive");
}

PositionTable read_sbet(const PositionText& text, const PositionOptions& options) {
  PositionTable table;
  table.kind = PositionTable::Kind::kPath;
  const auto records = read_records<SbetRecord>(text.path, "SBET");
  double wander = 0;
  for (std::size_t r = 0; r < records.size(); ++r) {
    const SbetRecord& record = records[r];
    PositionTable::Row row;
    row.where = where_of_record(text.path, r);
    if (!is_place(record) || (r > 0 && record[0] < records[r - 1][0]))
      throw InputError(row.where + ": is no record of an SBET at time " + std::to_string(record[0]) +
                       " s: times must ascend, and latitudes lie in [-90, 90] degrees; export the file again");
    row.time_s = record[0];
    row.place = {record[2] * kDegreesPerRadian, record[1] * kDegreesPerRadian, record[3]};
    row.angles_deg = {(record[9] - record[10]) * kDegreesPerRadian, record[8] * kDegreesPerRadian,
                      record[7] * kDegreesPerRadian};
    row.angles = options.angles.value_or(AngleKind::kBody);
    wander = std::max(wander, std::abs(record[10]));
    table.rows.push_back(std::move(row));
  }
  if (wander > 1e-6)
    table.notes.push_back(text.path + ": has wander angles of up to " + std::to_string(wander * kDegreesPerRadian) +
                          " degrees; the heading is taken as platform heading minus wander angle");
  if (!options.accuracy.empty()) {
    set_accuracies(options.accuracy, table.rows);
    table.states_sigmas = table.states_angle_sigmas = true;
  }
  return table;
}

}  // namespace

const PositionFormat kSbet = {"sbet", "SBET of POSPac", is_sbet, read_sbet};

}  // namespace megablock
