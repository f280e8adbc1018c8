// Reads the section `positions` of the project file: files of positions (and attitudes) of images that other programs
// wrote. Their values take the place of those in the image headers, so that everything behind treats both alike.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "io/project/inputs/image_lookup.h"
#include "io/project/positions/exposures.h"
#include "io/project/positions/position_formats.h"
#include "io/project/positions/row_pose.h"
#include "io/project/project_sections.h"
#include "io/project/table_source.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

constexpr double kFarFromHeader = 50;  // m; single GNSS positions and rounded coordinates are nearer
constexpr double kFarHeight = 150;     // m; heights above the ellipsoid and above the geoid differ by less

struct PositionSource : TableSource {
  std::string exposures;
  bool sigmas_of_project = false;  // the project file states both sigmas, in place of those of the file
};

AngleKind angle_kind(const std::string& text, const std::string& where) {
  if (text == "yaw_pitch_roll") return AngleKind::kBody;
  if (text == "gimbal") return AngleKind::kGimbal;
  if (text == "omega_phi_kappa") return AngleKind::kOmegaPhiKappa;
  throw InputError(where + ": angles: '" + text + "' is not one of: yaw_pitch_roll, gimbal, omega_phi_kappa");
}

PositionSource read_source(YamlReader reader) {
  PositionSource source;
  read_table_source(reader, "positions", source);
  source.exposures = reader.existing_file("exposures").value_or("");
  if (const auto angles = reader.text("angles")) source.options.angles = angle_kind(*angles, reader.where("angles"));
  reader.finish();
  return source;
}

// The images that exposures may belong to: those of the folder that the project names, else those beside the file if
// there are any, else all.
std::vector<std::size_t> images_of_source(const PositionSource& source, const std::string& file,
                                          const std::vector<ScannedImage>& scanned) {
  std::vector<std::size_t> images, beside;
  const fs::path folder = fs::path(file).parent_path();
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    if (source.folder.empty() || scanned[i].name.starts_with(source.folder + "/")) images.push_back(i);
    if (fs::path(scanned[i].path).parent_path() == folder) beside.push_back(i);
  }
  if (images.empty())
    throw InputError(source.where + ": images: the block has no image in folder '" + source.folder + "'");
  return source.folder.empty() && !beside.empty() ? beside : images;
}

// Gives every row its image.
class RowsOfImages {
 public:
  RowsOfImages(const PositionSource& source, const std::vector<ScannedImage>& scanned, Project& project)
      : source_(source), scanned_(scanned), project_(project) {}

  // [images]; no value: the file has no row for the image.
  std::vector<std::optional<PositionTable::Row>> find(const ImageLookup& lookup) {
    PositionTable table = read_position_table(source_.path, source_.options);
    std::string file = source_.path;
    if (!source_.exposures.empty()) {
      const PositionTable exposures = read_position_table(source_.exposures, {});
      if (exposures.kind != PositionTable::Kind::kExposures || table.kind == PositionTable::Kind::kImages)
        throw InputError(source_.where +
                         ": 'exposures' is for a _Timestamp.MRK of DJI beside 'file' with a solution of RTKLIB");
      table = exposures_on(table, exposures, source_.path, table.notes);
      file = source_.exposures;
    } else {
      // Offsets of exposures belong to the antenna. DJI has applied them to its own positions.
      for (PositionTable::Row& row : table.rows) row.offset_m.setZero();
    }
    crs_ = table.crs;
    note_zero_sigmas(table);
    rows_.resize(scanned_.size());
    if (table.kind == PositionTable::Kind::kImages)
      by_name(table, lookup);
    else if (table.kind == PositionTable::Kind::kExposures)
      by_exposure(table, file);
    else if (table.kind == PositionTable::Kind::kOrdered)
      by_order(table);
    else
      by_time(table);
    for (const std::string& note : table.notes) project_.warnings.push_back(note);
    return std::move(rows_);
  }

  const std::string& crs() const { return crs_; }

 private:
  // In the project file 0 holds a position; programs write it where they know nothing.
  void note_zero_sigmas(PositionTable& table) const {
    const auto zeros = std::ranges::count_if(table.rows, &PositionTable::Row::zero_sigma);
    if (zeros == 0 || source_.sigmas_of_project) return;
    table.notes.push_back(fmt::format(
        "{}: {} of {} lines state a sigma of 0, which counts as not stated (default 3 m, vertical 6 m); write the "
        "sigmas that are true, or hold the positions with 'gps: {{sigma_horizontal_m: 0, "
        "sigma_vertical_m: 0}}'",
        std::ranges::find_if(table.rows, &PositionTable::Row::zero_sigma)->where, zeros, table.rows.size()));
  }

  void by_name(const PositionTable& table, const ImageLookup& lookup) {
    std::size_t absent = 0, used = 0;
    const PositionTable::Row* first_absent = nullptr;
    for (const PositionTable::Row& row : table.rows) {
      const ImageLookup::Found found = find_image(row.image, lookup);
      if (found.kind == ImageLookup::Kind::kAmbiguous)
        throw InputError(row.where + ": several images of the block have the name '" + row.image +
                         "'; write it with its folder");
      if (found.kind != ImageLookup::Kind::kImage) {
        if (absent++ == 0) first_absent = &row;
        continue;
      }
      auto& place = rows_[static_cast<std::size_t>(found.image.value)];
      if (place)
        throw InputError(row.where + ": image '" + row.image + "' has a position in " + place->where +
                         " already; delete one of the lines");
      place = row;
      ++used;
    }
    if (used == 0)
      throw InputError(first_absent->where + ": the block has none of the images of this file (the first is '" +
                       first_absent->image + "'); give the file that belongs to these images, or correct the names");
    if (absent > 0)
      project_.warnings.push_back(
          fmt::format("{}: {} of {} lines are not used, because the block has no such image (the "
                      "first is '{}')",
                      first_absent->where, absent, table.rows.size(), first_absent->image));
  }

  // A name means the image of the folder that the project names, else of the file's own folder, else of any.
  ImageLookup::Found find_image(const std::string& name, const ImageLookup& lookup) const {
    std::string folder = source_.folder;
    if (folder.empty())
      folder = fs::path(source_.path).parent_path().lexically_relative(project_.block.image_folder).generic_string();
    const ImageLookup::Found inside = lookup.find(folder + "/" + name);
    return inside.kind == ImageLookup::Kind::kImage ? inside : lookup.find(name);
  }

  std::vector<ImageTime> times_of(const std::vector<std::size_t>& images) const {
    std::vector<ImageTime> times;
    for (const std::size_t i : images) times.push_back(time_of_image(scanned_[i]));
    return times;
  }

  void by_exposure(const PositionTable& table, const std::string& file) {
    const std::vector<std::size_t> images = images_of_source(source_, file, scanned_);
    const std::vector<std::int64_t> rows = rows_of_images(table, times_of(images), file);
    for (std::size_t i = 0; i < images.size(); ++i)
      if (rows[i] >= 0) rows_[images[i]] = table.rows[static_cast<std::size_t>(rows[i])];
  }

  void by_order(const PositionTable& table) {
    const std::vector<std::size_t> images = images_of_source(source_, source_.path, scanned_);
    if (images.size() != table.rows.size())
      throw InputError(
          fmt::format("{}: has {} poses for {} images; a file without names needs one for each, in the "
                      "order of their names",
                      source_.path, table.rows.size(), images.size()));
    for (std::size_t i = 0; i < images.size(); ++i) rows_[images[i]] = table.rows[i];
  }

  void by_time(PositionTable& table) {
    const std::vector<std::size_t> images = images_of_source(source_, source_.path, scanned_);
    const auto rows = rows_on_path(table, times_of(images), source_.time_offset_s, source_.path);
    for (std::size_t i = 0; i < images.size(); ++i)
      if (!rows[i].where.empty()) rows_[images[i]] = rows[i];
  }

  const PositionSource& source_;
  const std::vector<ScannedImage>& scanned_;
  Project& project_;
  std::string crs_;
  std::vector<std::optional<PositionTable::Row>> rows_;
};

// Writes the rows of one file into the headers.
class IntoHeaders {
 public:
  IntoHeaders(const PositionSource& source, const std::string& crs)
      : source_(source), name_(fs::path(source.path).filename()), system_(crs, source.path) {}

  void operator()(const PositionTable::Row& row, ScannedImage& image) const {
    ImageHeader& header = image.header;
    if (!row.place.head<2>().allFinite()) return;
    if (!system_.local()) {
      const Geodetic place = system_.position(row);
      header.position = place;
      if (states_attitude(row)) header.attitude = {system_.rotation(row, place), name_};
    } else {
      image.local_position = row.place;
      if (std::isnan(row.place.z()))
        throw InputError(row.where + ": the height is missing; positions in the block's own frame need one");
      if (states_attitude(row)) image.local_attitude = rotation_of(row);
      if (states_attitude(row)) header.attitude.reset();
    }
    header.position_source = name_;
    header.fix = ImageHeader::Fix::kUnstated;
    header.dop = kNoNumber;
    header.position_sigma_horizontal_m = source_.sigma_horizontal.value_or(row.sigma_horizontal_m);
    header.position_sigma_vertical_m = source_.sigma_vertical.value_or(row.sigma_vertical_m);
  }

 private:
  const PositionSource& source_;
  std::string name_;
  SystemOfTable system_;
};

double flat_distance_m(const Geodetic& a, const Geodetic& b) {
  constexpr double kMetresPerDegree = 111320;
  const double east = std::remainder(a.longitude_deg - b.longitude_deg, 360.0) * std::cos(a.latitude_deg * kDegree);
  return std::hypot(east, a.latitude_deg - b.latitude_deg) * kMetresPerDegree;
}

// Compares the positions of a file with those of the headers.
class FromHeaders {
 public:
  void add(const Geodetic& header, const Geodetic& file) {
    distances_.push_back(flat_distance_m(header, file));
    const double higher = file.height_m - header.height_m;
    if (std::isfinite(higher)) heights_.push_back(higher);
  }
  void report(const std::string& path, std::vector<std::string>& warnings) const {
    constexpr std::size_t kFewest = 3;
    if (distances_.size() >= kFewest && median(distances_) > kFarFromHeader)
      warnings.push_back(
          fmt::format("{}: its positions lie {:.0f} m (median) from those of the image headers; check that it belongs "
                      "to these images and is in the coordinate system that it names",
                      path, median(distances_)));
    if (heights_.size() < kFewest) return;
    const double higher = median(heights_);
    if (std::abs(higher) > kFarHeight)
      warnings.push_back(
          fmt::format("{}: its heights are {:.0f} m (median) {} those of the image headers; check whether they are in "
                      "feet ('altitude (ft)' as the name of the column converts them) or count from another level (the "
                      "take-off)",
                      path, std::abs(higher), higher > 0 ? "above" : "below"));
  }

 private:
  std::vector<double> distances_, heights_;
};

}  // namespace

bool read_position_files(YamlReader& top, std::vector<ScannedImage>& scanned, Project& project) {
  auto sources = read_table_sources<PositionSource>(top, "positions", read_source);
  if (sources.empty()) return false;
  auto gps = top.mapping("gps");
  const auto states = [&](const std::optional<double>& own, const char* key) {
    return own.has_value() || (gps && gps->node(key));
  };
  for (PositionSource& source : sources)
    source.sigmas_of_project =
        states(source.sigma_horizontal, "sigma_horizontal_m") && states(source.sigma_vertical, "sigma_vertical_m");
  if (scanned.empty()) refuse_unused(top, "positions", "with 'block', which has its own positions");
  std::vector<std::string> left_out = project.copies;
  for (const auto& [name, reason] : project.unreadable) left_out.push_back(name);
  const ImageLookup lookup(project.block, left_out);
  // Positions of headers are of another accuracy and often of another height datum, so none of them stays.
  std::vector<std::optional<Geodetic>> before;
  for (ScannedImage& image : scanned) {
    before.push_back(image.header.position);
    image.header.position.reset();
  }
  std::vector<const PositionSource*> source_of(scanned.size(), nullptr);
  for (const PositionSource& source : sources) {
    RowsOfImages finder(source, scanned, project);
    const auto rows = finder.find(lookup);
    const IntoHeaders write(source, finder.crs());
    FromHeaders from_headers;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (!rows[i]) continue;
      if (source_of[i] != nullptr)
        throw InputError(source.where + ": image '" + scanned[i].name + "' has a position in '" + source_of[i]->path +
                         "' and in '" + source.path +
                         "'; leave out one of the files, or give 'images: FOLDER' for each");
      source_of[i] = &source;
      write(*rows[i], scanned[i]);
      if (before[i] && scanned[i].header.position) from_headers.add(*before[i], *scanned[i].header.position);
    }
    from_headers.report(source.path, project.warnings);
  }
  const std::int64_t without = std::ranges::count_if(
      scanned, [](const ScannedImage& image) { return !image.header.position && !image.local_position; });
  if (without > 0)
    project.warnings.push_back(
        fmt::format("{}: {} of {} images have no position in the files of 'positions'; the positions "
                    "of their headers are not used",
                    top.where("positions"), without, scanned.size()));
  return true;
}

}  // namespace megablock
