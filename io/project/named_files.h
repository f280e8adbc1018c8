// Lists the files that a project file names, so that commands refuse to overwrite them with their output.
#pragma once

#include <string>
#include <vector>

namespace megablock {

// Returns the absolute paths of those that exist, files and folders. `made` is a key (of any section) that is skipped,
// because the command writes the file of this key itself. Throws InputError if the project file cannot be read.
std::vector<std::string> files_named_in(const std::string& project, const std::string& made);

}  // namespace megablock
