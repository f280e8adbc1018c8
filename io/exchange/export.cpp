#include "io/exchange/export.h"

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

void export_result(const BlockResult& result, const std::string& format, const std::string& out) {
  const ExportFormat& found = format_named(writers(), format, "export");
  check_parent(out);
  if (!found.files.empty()) make_folder(out);
  found.write(result, out);
}

}  // namespace megablock
