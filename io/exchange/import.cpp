#include "io/exchange/import.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/base/error.h"
#include "io/base/file_error.h"
#include "io/exchange/bal/import_bal.h"
#include "io/exchange/colmap/import_colmap.h"
#include "io/store/units/block_file.h"
#include "io/store/units/tracks_file.h"
#include "io/text/format_list.h"
#include "io/text/text_writer.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

struct ImportFormat {
  std::string name;
  ImportedBlock (*read)(const std::string&);
};

const std::vector<ImportFormat>& readers() {
  static const std::vector<ImportFormat> all = {{"colmap-text", import_colmap_text},
                                                {"colmap-bin", import_colmap_binary},
                                                {"bal", import_bal},
                                                {"bundler", import_bundler}};
  return all;
}

constexpr const char* kImportedProject =
    "# Imported block; all keys: reference/project-file.md in share/doc/megablock/docs of the installation\n"
    "block: given.h5\ntie_points: tie_points.h5\n";

// Throws InputError if there is a project file with other contents. It belongs to another block, or was edited.
void refuse_other_project(const fs::path& path) {
  if (!fs::exists(path)) return;
  std::ifstream file(path);
  if (std::string(std::istreambuf_iterator<char>(file), {}) != kImportedProject)
    throw InputError(path.string() +
                     ": this project file exists and differs from that of the import: it was edited, or belongs to "
                     "another block; name another folder with -o, or move it away");
}

}  // namespace

const std::vector<std::string>& import_formats() {
  static const std::vector<std::string> names = names_of(readers());
  return names;
}

ImportedBlock import_block(const std::string& format, const std::string& path) {
  return format_named(readers(), format, "import").read(path);
}

void write_imported(const ImportedBlock& imported, const std::string& folder) {
  make_folder(folder);
  const fs::path root(folder);
  refuse_other_project(root / "block.yaml");
  write_block((root / "given.h5").string(), imported.block);
  write_tracks((root / "tie_points.h5").string(), imported.tracks);
  TextWriter project((root / "block.yaml").string());
  project.print("{}", kImportedProject);
  project.close();
}

}  // namespace megablock
