#include "io/project/image_scan.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>

#include "geometry/numbers/median.h"
#include "io/base/error.h"
#include "io/base/hash.h"
#include "io/images/readout_table.h"
#include "io/project/inputs/camera_priors.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

std::vector<std::string> image_names(const fs::path& folder, std::vector<std::string>& warnings) {
  std::vector<std::string> names;
  std::vector<fs::path> open = {folder};
  while (!open.empty()) {
    const fs::path current = open.back();
    open.pop_back();
    std::error_code error;
    fs::directory_iterator items(current, error);
    if (error) {
      const std::string reason = "folder '" + current.string() + "' cannot be read: " + error.message();
      if (current == folder) throw InputError(reason + "; check its permissions");
      warnings.push_back(reason + "; its images are left out");
      continue;
    }
    for (const fs::directory_entry& item : items) {
      if (is_leftover(item.path())) continue;
      if (item.is_directory(error) && !item.is_symlink(error))
        open.push_back(item.path());
      else if (is_image_name(item.path().string()) && !item.is_directory(error))
        names.push_back(item.path().lexically_relative(folder).generic_string());
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

bool is_leftover(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.starts_with(".") || name == "@eaDir" || name == "__MACOSX" || name == "$RECYCLE.BIN";
}

std::vector<ScannedImage> scan_images(const std::string& folder, Project& project) {
  // The names are sorted before anything depends on their order, so indices do not depend on the file system. Threads
  // write to their own rows, and copies are found afterwards in this order.
  const std::vector<std::string> names = image_names(folder, project.warnings);
  std::vector<ScannedImage> all(names.size());
  std::vector<std::string> failures(names.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < names.size(); ++i) {
    all[i].name = names[i];
    all[i].path = (fs::path(folder) / names[i]).string();
    try {
      all[i].header = read_image_header(all[i].path);
      all[i].hash = hash_file(all[i].path);
    } catch (const std::exception& error) {
      failures[i] = error.what();
    }
  }
  std::vector<ScannedImage> scanned;
  std::map<std::uint64_t, std::string> seen;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!failures[i].empty()) {
      project.unreadable.emplace_back(all[i].name, failures[i]);
      continue;
    }
    const auto [first, inserted] = seen.emplace(all[i].hash, all[i].name);
    if (inserted) {
      scanned.push_back(std::move(all[i]));
      continue;
    }
    project.copies.push_back(all[i].name);
    project.warnings.push_back("image '" + all[i].name + "' is a copy of '" + first->second + "'; left out");
  }
  return scanned;
}

namespace {

std::string camera_name(const ScannedImage& image, CameraGrouping grouping) {
  const ImageHeader& h = image.header;
  const std::string size = std::to_string(h.width) + "x" + std::to_string(h.height);
  if (grouping == CameraGrouping::kOne) return "camera " + size;
  if (grouping == CameraGrouping::kFolder) {
    const std::string parent = fs::path(image.name).parent_path().generic_string();
    return (parent.empty() ? "." : parent) + " " + size;
  }
  std::string name = h.model.starts_with(h.make) ? h.model : h.make + " " + h.model;
  if (h.make.empty()) name = h.model;
  if (name.empty()) name = "unknown";
  name += " " + size;
  char focal[32];
  std::snprintf(focal, sizeof focal, " %.2fmm", h.focal_mm);
  return std::isnan(h.focal_mm) ? name : name + focal;
}

Camera make_camera(const std::string& name, const ImageHeader& header) {
  Camera camera;
  camera.name = name;
  camera.width = header.width;
  camera.height = header.height;
  const auto focal = focal_px(header);
  camera.focal_known = focal.has_value();
  camera.intrinsics[kFocal] = focal.value_or(usual_focal_px(header.width, header.height));
  camera.intrinsics[kPrincipalX] = header.width / 2.0;
  camera.intrinsics[kPrincipalY] = header.height / 2.0;
  camera.prior_sigma = default_intrinsic_sigmas(camera);
  camera.choose = true;
  camera.readout_s = readout_time_s(header.make, header.model, 1e-6 * header.width * header.height).value_or(0);
  camera.estimate_readout = camera.readout_s != 0;
  return camera;
}

}  // namespace

void add_images(const std::vector<ScannedImage>& scanned, CameraGrouping grouping, Block& block) {
  std::map<std::string, RigIndex> rig_of_camera;
  for (const ScannedImage& image : scanned) {
    const std::string name = camera_name(image, grouping);
    auto [found, inserted] = rig_of_camera.emplace(name, block.rigs.next_index());
    if (inserted) {
      Rig rig{name, {Mount{block.cameras.next_index(), {}}}};
      block.cameras.push_back(make_camera(name, image.header));
      block.rigs.push_back(std::move(rig));
    }
    block.add_image(image.name, {block.frames.next_index(), 0, image.hash});
    Frame frame;
    frame.name = image.name;
    frame.rig = found->second;
    frame.time_s = image.header.time_s;
    block.frames.push_back(std::move(frame));
  }
}

namespace {

std::string text_of(const Geodetic& p) {
  char text[64];
  std::snprintf(text, sizeof text, "%.6f, %.6f", p.latitude_deg, p.longitude_deg);
  return text;
}

// Position in metres (east, north) relative to a reference. The approximation is good enough to find outliers.
Eigen::Vector2d flat_metres(const Geodetic& p, const Geodetic& reference) {
  // Along meridians and along the equator, to one per cent. std::remainder closes the circle at 180 degrees.
  constexpr double kMetresPerDegree = 111320;
  double east = std::remainder(p.longitude_deg - reference.longitude_deg, 360.0);
  east *= kMetresPerDegree * std::cos(reference.latitude_deg * 3.14159265358979 / 180);
  return {east, (p.latitude_deg - reference.latitude_deg) * kMetresPerDegree};
}

// The reason why a position is wrong, whatever the other positions are; empty if it is plausible.
std::string implausible(const Geodetic& p) {
  if (!std::isfinite(p.latitude_deg) || !std::isfinite(p.longitude_deg)) return "is not a number";
  if (std::abs(p.latitude_deg) < 1e-6 && std::abs(p.longitude_deg) < 1e-6) return "is 0, 0 (receiver without a fix)";
  if (std::abs(p.latitude_deg) > 90 && std::abs(p.longitude_deg) <= 90)
    return "has latitude and longitude swapped (" + text_of(p) + ")";
  if (std::abs(p.latitude_deg) > 90 || std::abs(p.longitude_deg) > 180) return "is out of range (" + text_of(p) + ")";
  return "";
}

constexpr double kOutlierSpreads = 10;   // an outlier is farther away than so many median distances from the median
constexpr double kOutlierMetres = 1000;  // and farther away than this

}  // namespace

Geodetic rounded_median(const std::vector<Geodetic>& positions) {
  std::vector<double> latitude, longitude, height;
  for (const Geodetic& p : positions) {
    latitude.push_back(p.latitude_deg);
    longitude.push_back(p.longitude_deg);
    if (std::isfinite(p.height_m)) height.push_back(p.height_m);
  }
  return {std::round(median(latitude) * 1000) / 1000, std::round(median(longitude) * 1000) / 1000,
          height.empty() ? 0 : std::round(median(height) / 10) * 10};
}

std::vector<std::optional<Geodetic>> screen_positions(const std::vector<ScannedImage>& scanned,
                                                      std::vector<std::string>& warnings) {
  std::vector<std::optional<Geodetic>> result(scanned.size());
  std::vector<Geodetic> plausible;
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    const auto& position = scanned[i].header.position;
    if (!position) continue;
    const std::string reason = implausible(*position);
    if (reason.empty())
      plausible.push_back(*(result[i] = position));
    else
      warnings.push_back("image '" + scanned[i].name + "': its GPS position " + reason + "; not used");
  }
  // The median of two cannot tell which one is wrong.
  if (plausible.size() < 3) return result;

  std::vector<double> latitude, longitude, height;
  for (const Geodetic& p : plausible) {
    latitude.push_back(p.latitude_deg);
    longitude.push_back(p.longitude_deg);
    if (std::isfinite(p.height_m)) height.push_back(p.height_m);
  }
  const Geodetic centre{median(latitude), median(longitude), height.empty() ? 0 : median(height)};
  std::vector<double> distance, height_distance = {0};
  for (const Geodetic& p : plausible) {
    distance.push_back(flat_metres(p, centre).norm());
    if (std::isfinite(p.height_m)) height_distance.push_back(std::abs(p.height_m - centre.height_m));
  }
  const double limit = std::max(kOutlierMetres, kOutlierSpreads * median(distance));
  const double height_limit = std::max(kOutlierMetres, kOutlierSpreads * median(height_distance));
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    if (!result[i]) continue;
    const double far = flat_metres(*result[i], centre).norm();
    if (far > limit) {
      const Geodetic swapped{result[i]->longitude_deg, result[i]->latitude_deg, result[i]->height_m};
      const bool is_swapped = flat_metres(swapped, centre).norm() <= limit;
      char text[128];
      std::snprintf(text, sizeof text, "%.1f km from the others", far / 1000);
      warnings.push_back("image '" + scanned[i].name + "': its GPS position (" + text_of(*result[i]) + ") is " + text +
                         (is_swapped ? ", latitude and longitude look swapped" : "") + "; not used");
      result[i].reset();
    } else if (std::abs(result[i]->height_m - centre.height_m) > height_limit) {
      warnings.push_back("image '" + scanned[i].name + "': its GPS height is far from the others'; not used");
      result[i]->height_m = ImageHeader::kUnknown;
    }
  }
  return result;
}

}  // namespace megablock
