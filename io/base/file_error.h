// Failures of the operating system while writing or reading files, as the project's errors.
#pragma once

#include <fstream>
#include <string>

namespace megablock {

// Throws for `error` (an errno value) met while `action` ("written", "created" ...) was tried on `path`. What the user
// can mend (full disk or quota, read-only or missing permission, a file in the way) is an InputError with its remedy,
// everything else a StoreError.
[[noreturn]] void throw_file_error(const std::string& path, const std::string& action, int error);

// A file that the user names, to be read. Throws as above when it cannot be opened or is a folder.
std::ifstream open_input(const std::string& path);

// Makes a folder and those above it. Throws as above when that is not possible.
void make_folder(const std::string& path);

// InputError when the folder that is to hold the file or folder `path` is not there: it may be mistyped.
void check_parent(const std::string& path);

}  // namespace megablock
