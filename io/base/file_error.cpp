#include "io/base/file_error.h"

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "io/base/error.h"

namespace megablock {

namespace fs = std::filesystem;

namespace {

// Advice for errors that the user can correct; null for the others.
const char* remedy(int error) {
  switch (error) {
    case ENOSPC:
      return "no space left on the device; free some or choose another disk, then run again";
    case EDQUOT:
      return "the disk quota is used up; free some space or raise the quota, then run again";
    case EROFS:
      return "the file system is read-only; choose a writable one";
    case EFBIG:
      return "larger than the file size limit; raise it (ulimit -f) and run again";
    case EACCES:
    case EPERM:
      return "permission denied; check the owner and mode of the file and its directory";
    case ENOTDIR:
    case EEXIST:
      return "a file is where a directory is needed; move it away or choose another path";
    case EISDIR:
      return "a directory is where a file is needed; move it away or choose another path";
    case ENOENT:
      return "no such file or directory; check the path";
    case ENAMETOOLONG:
      return "the path is too long; choose a shorter one";
    case EMFILE:
    case ENFILE:
      return "too many open files; raise the limit (ulimit -n)";
    default:
      return nullptr;
  }
}

}  // namespace

void throw_file_error(const std::string& path, const std::string& action, int error) {
  const std::string start = path + ": cannot be " + action + ": ";
  if (const char* advice = remedy(error)) throw InputError(start + advice);
  throw StoreError(start + std::generic_category().message(error) + "; check the disk");
}

std::ifstream open_input(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) throw_file_error(path, "read", EISDIR);
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw_file_error(path, "read", errno);
  return stream;
}

void make_folder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) throw_file_error(path, "created as a directory", error.value());
  if (!fs::is_directory(path, error)) throw_file_error(path, "used as a directory", ENOTDIR);
}

void check_parent(const std::string& path) {
  if (path.empty()) throw InputError("the output has no name; name a file or folder");
  const fs::path written = (fs::absolute(path) / "").lexically_normal().parent_path();  // without a slash at its end
  std::error_code error;
  if (!fs::is_directory(written.parent_path(), error))
    throw InputError(path + ": the folder '" + written.parent_path().string() +
                     "' does not exist; make it, or check the path");
}

}  // namespace megablock
