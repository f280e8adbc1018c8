// Failures of the operating system while writing or reading files, as the project's errors.
#pragma once

#include <string>

namespace megablock {

// Throws for `error` (an errno value) met while `action` ("written", "created" ...) was tried on `path`. What the user
// can mend (full disk or quota, read-only or missing permission, a file in the way) is an InputError with its remedy,
// everything else a StoreError.
[[noreturn]] void throw_file_error(const std::string& path, const std::string& action, int error);

}  // namespace megablock
