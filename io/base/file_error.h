// Turns failures of the operating system with files into the errors of the project, with advice.
#pragma once

#include <fstream>
#include <string>

namespace megablock {

// Throws for the errno value `error`, which occurred when `path` was to be `action` ("written", "created"). Errors that
// the user can correct (full disk or quota, read-only file system, missing permission, a file in the way) become an
// InputError with the remedy; all others become a StoreError.
[[noreturn]] void throw_file_error(const std::string& path, const std::string& action, int error);

// Opens a file that the user names, for reading. Throws as above if it cannot be opened or is a folder.
std::ifstream open_input(const std::string& path);

// Makes a folder and its parents. Throws as above if that is impossible.
void make_folder(const std::string& path);

// Throws InputError if the folder that is to contain `path` does not exist: its name may be mistyped.
void check_parent(const std::string& path);

}  // namespace megablock
