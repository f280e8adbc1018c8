// Reads the section `trajectory` of the project file: files of poses of frames that other programs wrote, and finds the
// frame of each pose, by its name, by its time, or by its order.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "io/project/inputs/image_lookup.h"
#include "io/project/positions/position_formats.h"
#include "io/project/positions/row_pose.h"
#include "io/project/project_sections.h"
#include "io/project/table_source.h"
#include "io/text/csv_table.h"
#include "io/text/plausible.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

using Row = PositionTable::Row;

// Where neither the file nor the project states sigmas: those of images (project_priors.cpp).
constexpr Limits kGapLimits{1e-3, 1e6};  // metres, seconds
constexpr double kHorizontalM = 3, kVerticalM = 6, kTiltDeg = 3, kHeadingDeg = 10;

AngleKind looking_direction(const std::string& text, const std::string& where) {
  if (text == "ahead") return AngleKind::kGimbal;
  if (text == "down") return AngleKind::kBody;
  throw InputError(where + ": rig: '" + text +
                   "' is not one of: ahead (the z axis of the rig is that of the body forward), down");
}

void read_uses(YamlReader& reader, TrajectorySource& source) {
  const auto uses = reader.texts("use");
  if (!uses) return;
  source.start = source.positions = source.attitudes = false;
  for (const std::string& use : *uses) {
    if (use != "start" && use != "positions" && use != "attitudes")
      throw InputError(reader.where("use") + ": use: '" + use + "' is not one of: start, positions, attitudes");
    source.start |= use == "start";
    source.positions |= use == "positions";
    source.attitudes |= use == "attitudes";
  }
}

DriftModel read_drift(YamlReader reader) {
  DriftModel model;
  const auto set = [&](const char* key, double& field, const Limits& limits) {
    if (const auto value = reader.number(key)) {
      if (*value != 0) check_within(*value, limits, key, reader.where(key), ", or be 0");
      field = *value;
    }
  };
  set("sigma_position_m", model.sigma_position_m, kSigmaMetres);
  set("sigma_position_m_per_sqrt_m", model.sigma_position_per_sqrt_m, kSigmaMetres);
  set("sigma_rotation_deg", model.sigma_rotation_deg, kSigmaDegrees);
  set("sigma_rotation_deg_per_sqrt_s", model.sigma_rotation_deg_per_sqrt_s, kSigmaDegrees);
  model.max_gap_m = reader.number("max_gap_m", kGapLimits).value_or(model.max_gap_m);
  model.max_gap_s = reader.number("max_gap_s", kGapLimits).value_or(model.max_gap_s);
  if (model.sigma_position_m == 0 || model.sigma_rotation_deg == 0)
    throw InputError(reader.where() + ": relative: sigma_position_m and sigma_rotation_deg must be more than 0");
  reader.finish();
  return model;
}

TrajectorySource read_trajectory_source(YamlReader reader) {
  TrajectorySource source;
  read_table_source(reader, "trajectory", source);
  source.times = reader.existing_file("times").value_or("");
  if (const auto pass = reader.number("pass")) {
    if (*pass != std::floor(*pass)) throw InputError(reader.where("pass") + ": pass must be a whole number");
    source.pass = static_cast<std::int64_t>(*pass);
  }
  if (const auto arm = reader.numbers("lever_arm_m", 3)) {
    source.lever_arm = {(*arm)[0], (*arm)[1], (*arm)[2]};
    check_on_vehicle(*source.lever_arm, "trajectory.lever_arm_m", reader.where("lever_arm_m"));
  }
  source.options.angles = AngleKind::kGimbal;
  if (const auto rig = reader.text("rig")) source.options.angles = looking_direction(*rig, reader.where("rig"));
  source.sigma_tilt = reader.number("sigma_tilt_deg", kSigmaDegrees);
  source.sigma_heading = reader.number("sigma_heading_deg", kSigmaDegrees);
  read_uses(reader, source);
  if (auto relative = reader.mapping("relative")) source.relative = read_drift(*relative);
  reader.finish();
  return source;
}

// Gives every row of a file its frame.
class RowsOfFrames {
 public:
  RowsOfFrames(const TrajectorySource& source, const std::vector<ScannedImage>& scanned,
               const std::vector<std::string>& left_out, Project& project)
      : source_(source), scanned_(scanned), project_(project), block_(project.block), images_(block_, left_out) {
    for (FrameIndex f(0); block_.frames.contains(f); ++f.value) frame_of_name_.emplace(block_.frames[f].name, f);
    image_of_frame_.resize(block_.frames.size());
    for (ImageIndex i = block_.images.next_index(); i.value-- > 0;) image_of_frame_[block_.images[i].frame] = i;
  }

  std::map<FrameIndex, Row> find(PositionTable& table) {
    if (table.kind == PositionTable::Kind::kImages) return by_name(table);
    if (table.kind == PositionTable::Kind::kOrdered) return by_order(table);
    if (table.kind == PositionTable::Kind::kPath) return by_time(table);
    throw InputError(source_.path +
                     ": has exposures and no path; name it in 'positions', or give the solution of the whole drive");
  }

 private:
  std::map<FrameIndex, Row> by_name(const PositionTable& table) {
    std::map<FrameIndex, Row> rows;
    std::size_t absent = 0;
    const Row* first_absent = nullptr;
    for (const Row& row : table.rows) {
      const auto frame = frame_named(row.image, row.where);
      if (!frame) {
        if (absent++ == 0) first_absent = &row;
        continue;
      }
      const auto [place, inserted] = rows.emplace(*frame, row);
      if (!inserted)
        throw InputError(row.where + ": the frame of '" + row.image + "' has a pose in " + place->second.where +
                         " already; delete one of the lines");
    }
    if (rows.empty())
      throw InputError(first_absent->where +
                       ": the block has none of the frames and images of this file (the first is '" +
                       first_absent->image + "'); give the file that belongs to this block, or correct the names");
    if (absent > 0)
      project_.warnings.push_back(
          fmt::format("{}: {} of {} lines are not used, because the block has no such frame or image (the first is "
                      "'{}')",
                      first_absent->where, absent, table.rows.size(), first_absent->image));
    return rows;
  }

  std::optional<FrameIndex> frame_named(const std::string& name, const std::string& where) const {
    if (const auto found = frame_of_name_.find(name); found != frame_of_name_.end()) return found->second;
    const ImageLookup::Found image = images_.find(name);
    if (image.kind == ImageLookup::Kind::kAmbiguous)
      throw InputError(where + ": several images of the block have the name '" + name + "'; write it with its folder");
    if (image.kind != ImageLookup::Kind::kImage) return std::nullopt;
    return block_.images[image.image].frame;
  }

  // The frames that the file belongs to: those with images in the folder that the project names, else all.
  std::vector<FrameIndex> frames_of_source() const {
    std::vector<FrameIndex> frames;
    for (FrameIndex f(0); block_.frames.contains(f); ++f.value)
      if (source_.folder.empty() ||
          (image_of_frame_[f].valid() && block_.name_of(image_of_frame_[f]).starts_with(source_.folder + "/")))
        frames.push_back(f);
    if (frames.empty())
      throw InputError(source_.where + ": images: the block has no image in folder '" + source_.folder + "'");
    return frames;
  }

  std::map<FrameIndex, Row> by_order(const PositionTable& table) const {
    const std::vector<FrameIndex> frames = frames_of_source();
    if (frames.size() != table.rows.size())
      throw InputError(
          fmt::format("{}: has {} poses for {} frames; a file without names needs one for each, in their "
                      "order; give 'images: FOLDER' beside 'file' if it belongs to some of them",
                      source_.path, table.rows.size(), frames.size()));
    std::map<FrameIndex, Row> rows;
    for (std::size_t i = 0; i < frames.size(); ++i) rows.emplace(frames[i], table.rows[i]);
    return rows;
  }

  std::map<FrameIndex, Row> by_time(PositionTable& table) {
    std::map<FrameIndex, Row> result;
    if (!source_.times.empty()) {
      const std::map<FrameIndex, double> times = read_times();
      std::vector<double> values;
      for (const auto& [frame, time] : times)
        values.push_back(time + (std::isnan(source_.time_offset_s) ? 0 : source_.time_offset_s));
      const std::vector<Row> rows = interpolate(table, values);
      std::size_t i = 0;
      for (const auto& [frame, time] : times) add_on_path(frame, rows[i++], result);
    } else {
      const std::vector<FrameIndex> frames = frames_of_source();
      std::vector<ImageTime> times;
      for (const FrameIndex frame : frames) times.push_back(time_of_frame(frame));
      const std::vector<Row> rows = rows_on_path(table, times, source_.time_offset_s, source_.path);
      for (std::size_t i = 0; i < frames.size(); ++i) add_on_path(frames[i], rows[i], result);
    }
    if (result.empty())
      throw InputError(source_.path +
                       ": no frame of the block was taken while it was recorded; correct the times or 'time_offset_s'");
    return result;
  }

  static void add_on_path(FrameIndex frame, const Row& row, std::map<FrameIndex, Row>& rows) {
    if (!row.where.empty()) rows.emplace(frame, row);
  }

  // A given block has no headers. Its frames have the time of the trajectory.
  ImageTime time_of_frame(FrameIndex frame) const {
    const ImageIndex image = image_of_frame_[frame];
    if (!scanned_.empty() && image.valid()) return time_of_image(scanned_[static_cast<std::size_t>(image.value)]);
    return {block_.frames[frame].name, block_.frames[frame].time_s, block_.frames[frame].time_s};
  }

  std::map<FrameIndex, double> read_times() const {
    const CsvTable csv(source_.times);
    csv.require({"name", "time_s"});
    std::map<FrameIndex, double> times;
    for (std::size_t row = 0; row < csv.row_count(); ++row) {
      const auto frame = frame_named(csv.text(row, "name"), csv.where(row));
      if (frame) times.emplace(*frame, csv.needed_number(row, "time_s"));
    }
    if (times.empty())
      throw InputError(source_.times + ": the block has none of the frames and images of this file; correct the names");
    return times;
  }

  const TrajectorySource& source_;
  const std::vector<ScannedImage>& scanned_;
  Project& project_;
  const Block& block_;
  ImageLookup images_;
  std::map<std::string, FrameIndex> frame_of_name_;
  IndexedVector<FrameIndex, ImageIndex> image_of_frame_;  // the first
};

// The sigma of an observation: the project's, else the file's. A row without one, in a file that states others, is no
// observation; in a file that states none it gets the default.
double sigma_of(const std::optional<double>& project, double file, bool file_states_them, double otherwise) {
  if (project) return *project;
  return !std::isnan(file) || file_states_them ? file : otherwise;
}

Trajectories::ObservedPose observed_pose(FrameIndex frame, std::size_t index, const Row& row,
                                         const TrajectorySource& source, const SystemOfTable& system,
                                         const PositionTable& table) {
  Trajectories::ObservedPose pose;
  pose.frame = frame;
  pose.source = index;
  if (!row.place.allFinite())
    throw InputError(row.where + ": the height is missing; the poses of a trajectory need one");
  if (system.local())
    pose.local = row.place;
  else
    pose.geodetic = system.position(row);
  if (states_attitude(row)) pose.rotation = system.local() ? rotation_of(row) : system.rotation(row, *pose.geodetic);
  pose.sigma_m = {sigma_of(source.sigma_horizontal, row.sigma_horizontal_m, table.states_sigmas, kHorizontalM),
                  sigma_of(source.sigma_vertical, row.sigma_vertical_m, table.states_sigmas, kVerticalM)};
  pose.sigma_deg = {sigma_of(source.sigma_tilt, row.sigma_tilt_deg, table.states_angle_sigmas, kTiltDeg),
                    sigma_of(source.sigma_heading, row.sigma_heading_deg, table.states_angle_sigmas, kHeadingDeg)};
  pose.pass = source.pass ? source.pass : row.pass;
  pose.time_s = row.time_s;
  return pose;
}

std::string range_text(std::vector<double> values, const char* unit) {
  std::erase_if(values, [](double value) { return std::isnan(value); });
  if (values.empty()) return "none";
  const auto [least, most] = std::ranges::minmax(values);
  const std::string from = fmt::format("{:.3g}", least), to = fmt::format("{:.3g}", most);
  return (from == to ? to : from + " to " + to) + " " + unit;
}

// "trajectory: 800 of 800 frames from drive.csv: start, positions (sigma 0.02 m, vertical 0.05 m), attitudes (...)".
std::string line_of_source(const Trajectories& all, std::size_t index, std::size_t frames) {
  const TrajectorySource& source = all.sources[index];
  std::vector<double> horizontal, vertical, tilt, heading;
  std::size_t count = 0, turned = 0;
  for (const auto& pose : all.poses) {
    if (pose.source != index) continue;
    ++count;
    turned += pose.rotation.has_value();
    horizontal.push_back(pose.sigma_m.x()), vertical.push_back(pose.sigma_m.y());
    if (pose.rotation) tilt.push_back(pose.sigma_deg.x()), heading.push_back(pose.sigma_deg.y());
  }
  std::string uses;
  const auto add = [&](const std::string& use) { uses += (uses.empty() ? "" : ", ") + use; };
  if (source.start && turned > 0) add("start values");
  if (source.positions)
    add("positions (sigma " + range_text(horizontal, "m") + ", vertical " + range_text(vertical, "m") + ")");
  if (source.attitudes && turned > 0)
    add("attitudes (sigma " + range_text(tilt, "degrees") + ", heading " + range_text(heading, "degrees") + ")");
  if (source.relative && turned > 0) add("relative poses");
  return fmt::format("trajectory: {} of {} frames from {}: {}", count, frames,
                     fs::path(source.path).filename().string(), uses);
}

}  // namespace

Trajectories read_trajectories(YamlReader& top, const std::vector<ScannedImage>& scanned,
                               const std::vector<std::string>& left_out, Project& project) {
  Trajectories result;
  result.sources = read_table_sources<TrajectorySource>(top, "trajectory", read_trajectory_source);
  std::map<FrameIndex, std::size_t> source_of;
  for (std::size_t s = 0; s < result.sources.size(); ++s) {
    TrajectorySource& source = result.sources[s];
    if (!source.options.angles) source.options.angles = AngleKind::kGimbal;
    PositionTable table = read_position_table(source.path, source.options);
    const SystemOfTable system(table.crs, source.path);
    RowsOfFrames finder(source, scanned, left_out, project);
    for (const auto& [frame, row] : finder.find(table)) {
      const auto [other, fresh] = source_of.emplace(frame, s);
      if (!fresh)
        throw InputError(fmt::format(
            "{}: frame '{}' has a pose in '{}' and in '{}'; leave out one of the files, or "
            "give 'images: FOLDER' for each",
            source.where, project.block.frames[frame].name, result.sources[other->second].path, source.path));
      result.poses.push_back(observed_pose(frame, s, row, source, system, table));
    }
    if (source.relative &&
        std::ranges::none_of(result.poses, [&](const auto& pose) { return pose.source == s && pose.rotation; }))
      throw InputError(source.path + ": has no attitudes, which relative poses need; take 'relative' out");
    for (const std::string& note : table.notes) project.warnings.push_back(note);
    project.found.push_back(line_of_source(result, s, project.block.frames.size()));
  }
  const std::size_t without = project.block.frames.size() - source_of.size();
  if (!result.empty() && without > 0)
    project.warnings.push_back(fmt::format("{}: {} of {} frames have no pose in the files of 'trajectory'",
                                           top.where("trajectory"), without, project.block.frames.size()));
  return result;
}

}  // namespace megablock
