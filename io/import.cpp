#include "io/import.h"

#include <filesystem>

#include "io/error.h"
#include "io/import_bal.h"
#include "io/text_writer.h"
#include "io/unit_files.h"

namespace megablock {

namespace fs = std::filesystem;

ImportedBlock import_block(const std::string& format, const std::string& path) {
  if (format == "bal") return import_bal(path);
  if (format == "bundler") return import_bundler(path);
  if (format == "colmap-text") return import_colmap_text(path);
  throw InputError("'" + format + "' is no import format; they are bal, bundler, colmap-text");
}

void write_imported(const ImportedBlock& imported, const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder))
    throw InputError(folder + ": the folder cannot be made; check the path and its permissions");
  const fs::path root(folder);
  write_block((root / "given.h5").string(), imported.block);
  write_tracks((root / "tie_points.h5").string(), imported.tracks);
  TextWriter project((root / "block.yaml").string());
  project.print("# Imported block; keys: docs/project-file.md\nblock: given.h5\ntie_points: tie_points.h5\n");
  project.close();
}

}  // namespace megablock
