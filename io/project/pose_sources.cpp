#include "io/project/pose_sources.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace megablock {

namespace {

struct Range {
  double least = std::numeric_limits<double>::infinity(), most = 0;
  void add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  std::string text() const {
    const std::string from = fmt::format("{:.3g}", least), to = fmt::format("{:.3g}", most);
    return (from == to ? to : from + " to " + to) + " m";
  }
};

std::string fix_text(ImageHeader::Fix fix) {
  switch (fix) {
    case ImageHeader::Fix::kFixed:
      return ", RTK fixed";
    case ImageHeader::Fix::kFloat:
      return ", RTK float";
    case ImageHeader::Fix::kSingle:
      return ", single point";
    case ImageHeader::Fix::kUnstated:
      break;
  }
  return "";
}

}  // namespace

std::vector<std::string> lines_of_positions(const std::vector<ScannedImage>& scanned,
                                            const std::vector<Eigen::Vector2d>& position_sigmas_m) {
  struct Source {
    std::size_t images = 0, stated = 0;
    Range horizontal, vertical;
  };
  std::map<std::string, Source> sources;
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    if (!position_sigmas_m[i].allFinite()) continue;
    const ImageHeader& header = scanned[i].header;
    Source& source = sources[header.position_source + fix_text(header.fix)];
    ++source.images;
    source.stated += header.position_sigma_horizontal_m > 0;
    source.horizontal.add(position_sigmas_m[i].x());
    source.vertical.add(position_sigmas_m[i].y());
  }
  std::vector<std::string> lines;
  for (const auto& [name, source] : sources)
    lines.push_back(fmt::format("positions: {} of {} images from {}, sigma {}, vertical {}{}", source.images,
                                scanned.size(), name, source.horizontal.text(), source.vertical.text(),
                                source.stated == 0 ? " (not stated there)" : ""));
  if (lines.empty()) lines.emplace_back("positions: none");
  return lines;
}

std::vector<std::string> lines_of_attitudes(const std::vector<ScannedImage>& scanned, const std::vector<bool>& used,
                                            double tilt_sigma_deg, double heading_sigma_deg) {
  std::map<std::string, std::size_t> sources;
  std::size_t compass = 0;
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    const auto& attitude = scanned[i].header.attitude;
    if (used[i]) ++sources[attitude ? attitude->source : scanned[i].header.position_source];
    compass += !attitude && !scanned[i].local_attitude && !std::isnan(scanned[i].header.compass_deg);
  }
  std::vector<std::string> lines;
  for (const auto& [name, images] : sources)
    lines.push_back(fmt::format("attitudes: {} of {} images from {}, sigma {:.3g} degrees, heading {:.3g}", images,
                                scanned.size(), name, tilt_sigma_deg, heading_sigma_deg));
  if (lines.empty()) lines.emplace_back("attitudes: none");
  if (compass > 0)
    lines.push_back(
        fmt::format("compass: {} of {} images have a direction (GPSImgDirection) without pitch and roll; not "
                    "used",
                    compass, scanned.size()));
  return lines;
}

}  // namespace megablock
