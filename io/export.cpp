#include "io/export.h"

#include "io/export_bal.h"
#include "io/export_colmap.h"
#include "io/export_tables.h"
#include "io/file_error.h"
#include "io/format_list.h"

namespace megablock {

namespace {

struct ExportFormat {
  std::string name;
  bool folder;  // else one file
  void (*write)(const BlockResult&, const std::string&);
};

void export_h5(const BlockResult& result, const std::string& path) { write_result(path, result); }

const std::vector<ExportFormat>& writers() {
  static const std::vector<ExportFormat> all = {{"colmap-text", true, export_colmap_text},
                                                {"colmap-bin", true, export_colmap_binary},
                                                {"bal", false, export_bal},
                                                {"bundler", false, export_bundler},
                                                {"ply", false, export_ply},
                                                {"geojson", false, export_geojson},
                                                {"csv", true, export_csv},
                                                {"h5", false, export_h5}};
  return all;
}

}  // namespace

const std::vector<std::string>& export_formats() {
  static const std::vector<std::string> names = names_of(writers());
  return names;
}

void export_result(const BlockResult& result, const std::string& format, const std::string& out) {
  const ExportFormat& found = format_named(writers(), format, "export");
  check_parent(out);
  if (found.folder) make_folder(out);
  found.write(result, out);
}

}  // namespace megablock
