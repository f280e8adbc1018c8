#include "io/project/positions/exposures.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "io/project/positions/position_fields.h"
#include "io/project/positions/row_pose.h"

namespace megablock {

namespace {

constexpr double kLargestStep = 3;  // s, of the offset between header and exposure within a file
constexpr double kSameTime = 1.2;   // s, of an exposure and its image: headers have whole seconds
constexpr double kEnoughExposures = 0.9, kRival = 0.8;
constexpr double kPathGap = 5, kCubicSpan = 4;  // s
constexpr double kSameEvent = 0.1;              // s
constexpr double kQuarter = 900;                // s, the step of time zones
constexpr double kTimeSigma = 0.3;              // s, of times in whole seconds

// The last group of at least three digits of a name without folder and ending; -1 if there is none.
std::int64_t exposure_number(const std::string& name) {
  const std::string last = name.substr(name.find_last_of('/') + 1), stem = last.substr(0, last.find_last_of('.'));
  std::int64_t number = -1;
  for (std::size_t at = 0; at < stem.size();) {
    std::size_t end = at;
    while (end < stem.size() && stem[end] >= '0' && stem[end] <= '9') ++end;
    if (end - at >= 3 && end - at <= 9) number = std::stoll(stem.substr(at, end - at));
    at = end + 1;
  }
  return number;
}

std::vector<std::int64_t> rows_by_number(const PositionTable& table, const std::vector<ImageTime>& images) {
  std::map<std::int64_t, std::int64_t> row_of;
  for (std::size_t r = 0; r < table.rows.size(); ++r)
    if (table.rows[r].number < 0 || !row_of.emplace(table.rows[r].number, static_cast<std::int64_t>(r)).second)
      return {};
  std::vector<std::int64_t> rows;
  std::map<std::int64_t, double> clock_of;  // of the first image with a number
  for (const ImageTime& image : images) {
    const auto found = row_of.find(exposure_number(image.name));
    if (found == row_of.end()) return {};
    const auto [first, inserted] = clock_of.emplace(found->second, image.clock_s);
    if (!inserted && !(std::abs(first->second - image.clock_s) <= kSameTime)) return {};
    rows.push_back(found->second);
  }
  return rows;
}

// Images in the order of time where all have one, else of name.
std::vector<std::size_t> image_order(const std::vector<ImageTime>& images) {
  std::vector<std::size_t> order(images.size());
  std::iota(order.begin(), order.end(), 0);
  const bool timed = std::ranges::none_of(images, [](const ImageTime& image) { return std::isnan(image.clock_s); });
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    if (timed && images[a].clock_s != images[b].clock_s) return images[a].clock_s < images[b].clock_s;
    return images[a].name < images[b].name;
  });
  return order;
}

std::vector<std::int64_t> rows_by_rank(const PositionTable& table, const std::vector<ImageTime>& images) {
  if (table.rows.size() != images.size()) return {};
  std::vector<std::size_t> row_order(table.rows.size());
  std::iota(row_order.begin(), row_order.end(), 0);
  std::ranges::stable_sort(row_order,
                           [&](std::size_t a, std::size_t b) { return table.rows[a].time_s < table.rows[b].time_s; });
  std::vector<std::int64_t> rows(images.size());
  const std::vector<std::size_t> order = image_order(images);
  for (std::size_t i = 0; i < order.size(); ++i) rows[order[i]] = static_cast<std::int64_t>(row_order[i]);
  return rows;
}

// The image, if any, whose offset between header and exposure differs from the others'.
const ImageTime* image_out_of_step(const PositionTable& table, const std::vector<ImageTime>& images,
                                   const std::vector<std::int64_t>& rows) {
  std::vector<double> offsets;
  for (std::size_t i = 0; i < images.size(); ++i)
    if (!std::isnan(images[i].clock_s))
      offsets.push_back(table.rows[static_cast<std::size_t>(rows[i])].time_s - images[i].clock_s);
  if (offsets.size() < 2) return nullptr;
  const double usual = median(offsets);
  for (std::size_t i = 0; i < images.size(); ++i)
    if (std::abs(table.rows[static_cast<std::size_t>(rows[i])].time_s - images[i].clock_s - usual) > kLargestStep)
      return &images[i];
  return nullptr;
}

// Pairs images and exposures of the same time, with an offset added to the clock of the camera. Both are in order.
struct Pairing {
  std::int64_t pairs = 0;
  std::vector<std::int64_t> rows;
};
Pairing pair_at(const std::vector<double>& exposures, const std::vector<double>& clocks, double offset) {
  Pairing pairing;
  pairing.rows.assign(clocks.size(), -1);
  std::size_t e = 0;
  for (std::size_t i = 0; i < clocks.size(); ++i) {
    const double time = clocks[i] + offset;
    while (e < exposures.size() && exposures[e] < time - kSameTime) ++e;
    if (e == exposures.size()) break;
    if (exposures[e] > time + kSameTime) continue;
    pairing.rows[i] = static_cast<std::int64_t>(e++);
    ++pairing.pairs;
  }
  return pairing;
}

std::vector<std::int64_t> rows_by_time(const PositionTable& table, const std::vector<ImageTime>& images,
                                       const std::string& path) {
  const auto refuse = [&](const std::string& why) {
    throw InputError(
        fmt::format("{}: its {} exposures cannot be told apart for {} images ({}); take away images without exposure "
                    "or lines without "
                    "image, or give 'images: FOLDER' beside 'file' in the project file",
                    path, table.rows.size(), images.size(), why));
  };
  if (std::ranges::any_of(images, [](const ImageTime& image) { return std::isnan(image.clock_s); }))
    refuse("numbers differ, and not all headers have times");
  const std::vector<std::size_t> order = image_order(images);
  std::vector<double> clocks, exposures;
  for (const std::size_t i : order) clocks.push_back(images[i].clock_s);
  for (const PositionTable::Row& row : table.rows) exposures.push_back(row.time_s);
  if (!std::ranges::is_sorted(exposures)) refuse("the lines are not in the order of time");
  Pairing best;
  double best_offset = 0;
  std::int64_t rival = 0;
  const auto attempt = [&](double offset) {
    Pairing pairing = pair_at(exposures, clocks, offset);
    // Offsets that are nearly the same find the same pairs and are no rivals.
    if (pairing.pairs > best.pairs) {
      if (std::abs(offset - best_offset) > 2 * kSameTime) rival = best.pairs;
      best = std::move(pairing);
      best_offset = offset;
    } else if (std::abs(offset - best_offset) > 2 * kSameTime) {
      rival = std::max(rival, pairing.pairs);
    }
  };
  // One of the first images has an exposure, unless very many have none.
  for (std::size_t i = 0; i < std::min<std::size_t>(3, clocks.size()); ++i)
    for (const double exposure : exposures) attempt(exposure - clocks[i]);
  const double possible = static_cast<double>(std::min(exposures.size(), clocks.size()));
  if (static_cast<double>(best.pairs) < kEnoughExposures * possible) refuse("their times do not fit");
  if (static_cast<double>(rival) > kRival * static_cast<double>(best.pairs)) refuse("their times fit in several ways");
  std::vector<std::int64_t> rows(images.size());
  for (std::size_t i = 0; i < order.size(); ++i) rows[order[i]] = best.rows[i];
  return rows;
}

// Value at `time` of the polynomial through the given epochs (Lagrange).
Eigen::Vector3d lagrange(const std::vector<PositionTable::Row>& rows, std::size_t first, std::size_t count,
                         double time) {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  for (std::size_t i = first; i < first + count; ++i) {
    double weight = 1;
    for (std::size_t j = first; j < first + count; ++j)
      if (j != i) weight *= (time - rows[j].time_s) / (rows[i].time_s - rows[j].time_s);
    value += weight * rows[i].place;
  }
  return value;
}

PositionTable::Row row_at(const std::vector<PositionTable::Row>& rows, double time) {
  PositionTable::Row result;
  result.time_s = time;
  const auto above = std::ranges::upper_bound(rows, time, {}, [](const PositionTable::Row& row) { return row.time_s; });
  std::size_t next = static_cast<std::size_t>(above - rows.begin());
  if (next == rows.size() && next > 0 && rows.back().time_s == time) --next;
  if (std::isnan(time) || next == 0 || next == rows.size()) return result;
  const PositionTable::Row &a = rows[next - 1], &b = rows[next];
  if (b.time_s - a.time_s > kPathGap) return result;
  const bool cubic = next >= 2 && next + 1 < rows.size() && rows[next + 1].time_s - rows[next - 2].time_s <= kCubicSpan;
  result.where = a.where;
  result.place = cubic ? lagrange(rows, next - 2, 4, time) : lagrange(rows, next - 1, 2, time);
  result.sigma_horizontal_m = std::fmax(a.sigma_horizontal_m, b.sigma_horizontal_m);
  result.sigma_vertical_m = std::fmax(a.sigma_vertical_m, b.sigma_vertical_m);
  result.pass = a.pass;
  if (!states_attitude(a) || !states_attitude(b)) return result;
  result.angles = a.angles;
  result.rotation = rotation_of(a).slerp((time - a.time_s) / (b.time_s - a.time_s), rotation_of(b)).normalized();
  result.sigma_tilt_deg = std::fmax(a.sigma_tilt_deg, b.sigma_tilt_deg);
  result.sigma_heading_deg = std::fmax(a.sigma_heading_deg, b.sigma_heading_deg);
  return result;
}

// Epochs in the order of time, each once.
std::vector<PositionTable::Row> epochs_of(const PositionTable& path) {
  std::vector<PositionTable::Row> rows = path.rows;
  std::ranges::stable_sort(rows, {}, &PositionTable::Row::time_s);
  const auto repeated = std::ranges::unique(rows, {}, &PositionTable::Row::time_s);
  rows.erase(repeated.begin(), repeated.end());
  return rows;
}

std::string zone_text(double zone_s) {
  const int minutes = static_cast<int>(std::abs(zone_s) / 60);
  return fmt::format("UTC{}{:02d}:{:02d}", zone_s < 0 ? "-" : "+", minutes / 60, minutes % 60);
}

// Metres per second along the path at each time, from the positions half a second before and after; 0 off the path.
std::vector<double> speeds_at(const PositionTable& path, const std::vector<double>& times, bool degrees) {
  std::vector<double> before = times, after = times, speeds;
  for (double& time : before) time -= 0.5;
  for (double& time : after) time += 0.5;
  const std::vector<PositionTable::Row> from = interpolate(path, before), to = interpolate(path, after);
  constexpr double kMetresPerDegree = 111320;  // along meridians and along the equator, to one per cent
  for (std::size_t i = 0; i < times.size(); ++i) {
    Eigen::Vector3d step = to[i].place - from[i].place;
    if (degrees) {
      step.x() *= kMetresPerDegree * std::cos(from[i].place.y() * kDegree);
      step.y() *= kMetresPerDegree;
    }
    speeds.push_back(step.allFinite() ? step.norm() : 0);
  }
  return speeds;
}

}  // namespace

std::vector<std::int64_t> rows_of_images(const PositionTable& table, const std::vector<ImageTime>& images,
                                         const std::string& path) {
  for (const auto by : {rows_by_number, rows_by_rank}) {
    const std::vector<std::int64_t> rows = by(table, images);
    if (rows.empty()) continue;
    if (const ImageTime* image = image_out_of_step(table, images, rows))
      throw InputError(path + ": its exposures do not belong to these images: the time of image '" + image->name +
                       "' does not fit, although those of most others do; give 'images: FOLDER' beside 'file' in the "
                       "project file, or take out images without exposure");
    return rows;
  }
  return rows_by_time(table, images, path);
}

void make_absolute(PositionTable& path, const std::vector<ImageTime>& images) {
  constexpr double kWeek = 7 * 86400;
  const auto [first, last] = std::ranges::minmax(path.rows, {}, &PositionTable::Row::time_s);
  const auto timed = std::ranges::find_if(
      images, [](const ImageTime& image) { return !std::isnan(image.gps_s) || !std::isnan(image.clock_s); });
  if (!(last.time_s < 2 * kWeek) || timed == images.end()) return;
  const double image = std::isnan(timed->gps_s) ? timed->clock_s : timed->gps_s;
  const double week = std::round((image - gps_week_seconds(0, 0) - (first.time_s + last.time_s) / 2) / kWeek);
  for (PositionTable::Row& row : path.rows) row.time_s = gps_week_seconds(week, row.time_s);
}

std::vector<PositionTable::Row> interpolate(const PositionTable& path, const std::vector<double>& times_s) {
  const std::vector<PositionTable::Row> epochs = epochs_of(path);
  std::vector<PositionTable::Row> rows;
  for (const double time : times_s) rows.push_back(row_at(epochs, time));
  return rows;
}

std::vector<double> times_on_path(const PositionTable& path, const std::vector<ImageTime>& images, double offset_s,
                                  const std::string& file, std::vector<std::string>& notes) {
  const auto [first, last] = std::ranges::minmax(path.rows, {}, &PositionTable::Row::time_s);
  std::vector<double> times;
  for (const ImageTime& image : images) times.push_back(std::isnan(offset_s) ? image.gps_s : image.clock_s + offset_s);
  const auto known = [](double time) { return !std::isnan(time); };
  if (std::ranges::any_of(times, known)) return times;
  std::vector<double> zones;
  const std::int64_t timed =
      std::ranges::count_if(images, [](const ImageTime& image) { return !std::isnan(image.clock_s); });
  for (int quarter = -14 * 4; quarter <= 14 * 4; ++quarter) {
    const double zone = quarter * kQuarter;
    const std::int64_t on_path = std::ranges::count_if(images, [&](const ImageTime& image) {
      const double time = image.clock_s - zone + leap_seconds(image.clock_s);
      return time >= first.time_s - 1 && time <= last.time_s + 1;
    });
    if (static_cast<double>(on_path) >= kEnoughExposures * static_cast<double>(timed)) zones.push_back(zone);
  }
  if (timed == 0 || zones.size() != 1)
    throw InputError(file + ": " +
                     (timed == 0      ? "the headers of the images have no times"
                      : zones.empty() ? "the images were not taken while it was recorded, whatever zone their clock has"
                                      : "the clock of the camera may have several zones") +
                     "; give 'time_offset_s' (GPS time minus time of the headers) beside 'file' in the project file");
  notes.push_back(file + ": the clock of the camera is taken as " + zone_text(zones[0]) +
                  ", the only zone that puts the images onto the path");
  for (std::size_t i = 0; i < images.size(); ++i)
    times[i] = images[i].clock_s - zones[0] + leap_seconds(images[i].clock_s);
  return times;
}

std::vector<PositionTable::Row> rows_on_path(PositionTable& path, const std::vector<ImageTime>& images, double offset_s,
                                             const std::string& file) {
  make_absolute(path, images);
  const std::vector<double> times = times_on_path(path, images, offset_s, file, path.notes);
  std::vector<PositionTable::Row> rows = interpolate(path, times);
  const bool whole =
      std::ranges::all_of(times, [](double time) { return std::isnan(time) || time == std::floor(time); });
  if (!whole) return rows;
  path.notes.push_back(
      file +
      ": the headers have times in whole seconds only; the sigmas of the positions grow by 0.3 s of flight. A file of "
      "exposures (_events.pos, _Timestamp.MRK) is better");
  const bool degrees = path.crs == "WGS84" || path.crs.starts_with("EPSG:4326");
  const std::vector<double> speeds = speeds_at(path, times, degrees);
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i].sigma_horizontal_m = std::hypot(rows[i].sigma_horizontal_m, kTimeSigma * speeds[i]);
  return rows;
}

PositionTable exposures_on(const PositionTable& solution, const PositionTable& exposures, const std::string& file,
                           std::vector<std::string>& notes) {
  std::vector<PositionTable::Row> places;
  const std::vector<PositionTable::Row> epochs = epochs_of(solution);
  for (const PositionTable::Row& exposure : exposures.rows) {
    if (solution.kind == PositionTable::Kind::kPath) {
      places.push_back(row_at(epochs, exposure.time_s));
      continue;
    }
    const auto nearest = std::ranges::min_element(
        epochs, {}, [&](const PositionTable::Row& row) { return std::abs(row.time_s - exposure.time_s); });
    const bool same = nearest != epochs.end() && std::abs(nearest->time_s - exposure.time_s) <= kSameEvent;
    places.push_back(same ? *nearest : PositionTable::Row());
  }
  PositionTable result = exposures;
  result.crs = solution.crs;
  result.rows.clear();
  std::size_t off = 0;
  for (std::size_t r = 0; r < places.size(); ++r) {
    off += places[r].where.empty();
    PositionTable::Row row = exposures.rows[r];
    row.place = places[r].where.empty() ? Eigen::Vector3d::Constant(kNoNumber) : places[r].place;
    row.sigma_horizontal_m = places[r].sigma_horizontal_m;
    row.sigma_vertical_m = places[r].sigma_vertical_m;
    result.rows.push_back(row);
  }
  if (off == places.size()) throw InputError(file + ": no exposure lies on it; give the solution of the same flight");
  if (off > 0)
    notes.push_back(
        fmt::format("{}: {} of {} exposures do not lie on it and get no position", file, off, places.size()));
  return result;
}

}  // namespace megablock
