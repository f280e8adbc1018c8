#include "io/exchange/export.h"

#include <fmt/core.h>

#include <cmath>
#include <filesystem>

#include "io/base/file_error.h"
#include "io/exchange/bal/export_bal.h"
#include "io/exchange/colmap/export_colmap.h"
#include "io/exchange/tables/export_tables.h"
#include "io/text/format_list.h"

namespace megablock {

namespace {

struct ExportFormat {
  std::string name;
  std::vector<std::string> files;  // files in the output folder; empty: the output is one file
  void (*write)(const BlockResult&, const std::string&);
};

void export_h5(const BlockResult& result, const std::string& path) { write_result(path, result); }

const std::vector<ExportFormat>& writers() {
  static const std::vector<ExportFormat> all = {
      {"colmap-text", {"cameras.txt", "images.txt", "points3D.txt"}, export_colmap_text},
      {"colmap-bin", {"cameras.bin", "images.bin", "points3D.bin"}, export_colmap_binary},
      {"bal", {}, export_bal},
      {"bundler", {}, export_bundler},
      {"ply", {}, export_ply},
      {"geojson", {}, export_geojson},
      {"csv", {"frames.csv", "images_local.csv", "images_wgs84.csv", "cameras.csv", "mounts.csv"}, export_csv},
      {"h5", {}, export_h5}};
  return all;
}

}  // namespace

const std::vector<std::string>& export_formats() {
  static const std::vector<std::string> names = names_of(writers());
  return names;
}

std::vector<std::string> export_files(const std::string& format, const std::string& out) {
  const ExportFormat& found = format_named(writers(), format, "export");
  std::vector<std::string> files;
  for (const std::string& name : found.files) files.push_back((std::filesystem::path(out) / name).string());
  if (files.empty()) files.push_back(out);
  if (format == "bundler") files.push_back(out + ".list.txt");
  return files;
}

std::string export_note(const BlockResult& result, const std::string& format) {
  const bool colmap = format.starts_with("colmap"), bal = format == "bal" || format == "bundler";
  std::string worst;
  double most = 0;
  for (std::size_t c = 0; (colmap || bal) && c < result.block.cameras.size(); ++c) {
    const CameraIndex index(static_cast<std::int64_t>(c));
    const Camera& camera = result.block.cameras[index];
    const Intrinsics& k = result.state.cameras[index];
    const auto affinity = find_parameter(k.model(), "b1"), skew = find_parameter(k.model(), "b2");
    if (!affinity || !skew) continue;
    // At the corners (f + b1) x' + b2 y' differs from f x' by this.
    const double lost = ((bal ? std::abs(k[static_cast<std::size_t>(*affinity)]) * camera.width : 0) +
                         std::abs(k[static_cast<std::size_t>(*skew)]) * camera.height) /
                        (2 * k[kFocal]);
    if (lost <= most) continue;
    most = lost;
    worst = camera.name;
  }
  if (most == 0) return "";
  return fmt::format(
      "{} files have no {} of the pixels: the observations are corrected for it, but the images of camera '{}' differ "
      "from the exported camera by up to {:.2g} px in the corners; leave {} out of 'calibrate' if that is too much",
      colmap ? "COLMAP" : "BAL and Bundler", colmap ? "skew (b2)" : "affinity and skew (b1, b2)", worst, most,
      colmap ? "b2" : "b1 and b2");
}

void export_result(const BlockResult& result, const std::string& format, const std::string& out) {
  const ExportFormat& found = format_named(writers(), format, "export");
  check_parent(out);
  if (!found.files.empty()) make_folder(out);
  found.write(result, out);
}

}  // namespace megablock
