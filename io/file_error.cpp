#include "io/file_error.h"

#include <cerrno>
#include <system_error>

#include "io/error.h"

namespace megablock {

namespace {

// What to do about an error the user can mend; null for the others.
const char* remedy(int error) {
  switch (error) {
    case ENOSPC:
      return "no space left on the device; free some or put the job on another disk, then run again";
    case EDQUOT:
      return "the disk quota is used up; free some space or raise the quota, then run again";
    case EROFS:
      return "the file system is read-only; put the job on a writable one";
    case EFBIG:
      return "larger than the file size limit; raise it (ulimit -f) and run again";
    case EACCES:
    case EPERM:
      return "permission denied; check the owner and mode of the directory";
    case ENOTDIR:
    case EEXIST:
      return "a file is where a directory is needed; move it away or choose another job directory";
    case EISDIR:
      return "a directory is where a file is needed; move it away";
    case ENOENT:
      return "no such file or directory; check the path";
    case ENAMETOOLONG:
      return "the path is too long; choose a shorter job directory";
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

}  // namespace megablock
