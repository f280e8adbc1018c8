#include "io/simulate/files/project_text.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/base/error.h"
#include "io/base/file_error.h"

namespace megablock {

void refuse_edited_project(const std::string& folder, const std::string& text, EditedProject edited) {
  const std::filesystem::path path = std::filesystem::path(folder) / "block.yaml";
  if (edited == EditedProject::kOverwrite || !std::filesystem::exists(path)) return;
  std::ifstream file(path);
  // The same simulation may be written again. Only a text that this program would not write counts as edited.
  if (std::string(std::istreambuf_iterator<char>(file), {}) == text) return;
  throw InputError(
      path.string() +
      ": this project file exists and differs from the new one: it was edited, or belongs to another simulation; "
      "name another folder with -o, or give --overwrite");
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream stream(path);
  stream << text;
  stream.close();
  if (!stream) throw_file_error(path, "written", errno);
}

}  // namespace megablock
